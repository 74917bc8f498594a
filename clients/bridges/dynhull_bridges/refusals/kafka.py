"""Kafka: the errors of its protocol and of aiokafka, by their classes there.

All others pass: `retriable` of aiokafka is false for some that do, as for a request that took too long.
"""

from aiokafka import errors

from .table import Meaning, Refusals

KAFKA = Refusals(
    {
        Meaning.PASSES: {
            errors.BrokerNotAvailableError: "a broker starts or ends",
            errors.CoordinatorLoadInProgressError: "the coordinator of the group is loading",
            errors.CoordinatorNotAvailableError: "the group has no coordinator yet",
            errors.KafkaConnectionError: "the connection is lost",
            errors.KafkaStorageError: "the disk of the broker fails",
            errors.KafkaTimeoutError: "no answer in time",
            errors.LeaderNotAvailableError: "the partition elects a leader",
            errors.NotCoordinatorError: "another broker coordinates the group now",
            errors.NotEnoughReplicasError: "replicas are away",
            errors.NotLeaderForPartitionError: "another broker leads the partition now",
            errors.RebalanceInProgressError: "the group changes its members",
            errors.ReplicaNotAvailableError: "a replica is away",
            errors.RequestTimedOutError: "no answer in time",
        },
        Meaning.DOUBTFUL: {errors.UnknownTopicOrPartitionError: "no such topic"},
        Meaning.FINAL: {
            errors.AuthenticationFailedError: "bad credentials",
            errors.AuthenticationMethodNotSupported: "the broker does not know the way to authenticate",
            errors.ClusterAuthorizationFailedError: "no rights on the cluster",
            errors.GroupAuthorizationFailedError: "no rights on the group",
            errors.IllegalSaslStateError: "a request before authentication",
            errors.IncompatibleBrokerVersion: "the broker is too old",
            errors.InvalidGroupIdError: "no name of a group",
            errors.InvalidRequestError: "malformed request",
            errors.InvalidTopicError: "no name of a topic",
            errors.KafkaConfigurationError: "the client cannot do this",
            errors.SaslAuthenticationFailed: "bad credentials",
            errors.TopicAuthorizationFailedError: "no rights on the topic",
            errors.UnrecognizedBrokerVersion: "the broker is too old",
            errors.UnsupportedCodecError: "a compression that the client does not know",
            errors.UnsupportedSaslMechanismError: "the broker does not know the way to authenticate",
            errors.UnsupportedVersionError: "the broker is too old",
        },
    },
    otherwise=Meaning.PASSES,
)

# What brokers and aiokafka say about records of the relay. All else is about the connection or the transaction.
RECORDS = Refusals(
    {
        Meaning.FINAL: {
            errors.InvalidTopicError: "no name of a topic",
            errors.MessageSizeTooLargeError: "too large for the topic, or for a request",
            errors.RecordListTooLargeError: "too large for a segment of the topic",
            errors.TopicAuthorizationFailedError: "no rights on the topic",
        },
    },
    otherwise=Meaning.PASSES,
)

"""MQTT: reason codes of CONNACK, SUBACK and PUBACK (MQTT 5, 2.4), to which the client translates those of 3.1.1.

A DISCONNECT refuses what is asked for before the subscription if its code is final; later the next CONNACK decides.
"""

from .table import Meaning, Refusals

MQTT = Refusals(
    {
        Meaning.PASSES: {
            0x88: "server unavailable; 3 in a CONNACK of 3.1.1",
            0x89: "server busy",
            0x91: "packet identifier in use",
            0x97: "quota exceeded",
            0x9C: "use another server, for the time being",
            0x9F: "connection rate exceeded",
        },
        Meaning.DOUBTFUL: {
            0x80: "unspecified error; in a SUBACK of 3.1.1 any failure",
            0x83: "implementation specific error",
        },
        Meaning.FINAL: {
            0x81: "malformed packet",
            0x82: "protocol error",
            0x84: "unsupported protocol version; 1 in a CONNACK of 3.1.1",
            0x85: "client identifier not valid; 2 in a CONNACK of 3.1.1",
            0x86: "bad user name or password; 4 in a CONNACK of 3.1.1",
            0x87: "not authorized; 5 in a CONNACK of 3.1.1",
            0x8A: "banned",
            0x8C: "bad authentication method",
            0x8F: "topic filter invalid",
            0x90: "topic name invalid",
            0x95: "packet too large",
            0x99: "payload format invalid",
            0x9A: "retain not supported",
            0x9B: "QoS not supported",
            0x9D: "server moved, for good",
            0x9E: "shared subscriptions not supported",
            0xA1: "subscription identifiers not supported",
            0xA2: "wildcard subscriptions not supported",
        },
    },
    otherwise=Meaning.PASSES,
)

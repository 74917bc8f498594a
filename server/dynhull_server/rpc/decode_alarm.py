"""Conversion of the rule of an alarm, and of what is asked of it."""

from dynhull_proto.v1 import alarm_pb2, alarm_service_pb2

from ..settings import NAME_CHARACTERS
from ..state.alarms.conditions import SILENT, Condition, condition_of
from ..state.alarms.places import ConditionError
from ..state.alarms.rule import AlarmRule
from ..state.alarms.values import require_area
from ..state.fences.model.config import FenceConfig
from .decode import LARGEST_INTEGER, NAME, NAME_WORDS, InvalidFieldError, decode_name
from .decode_settings import decode_duration


def decode_alarm_name(name: str) -> str:
    """The name of an alarm."""
    if not NAME.fullmatch(name):
        raise InvalidFieldError("name", name, f"an alarm's name is {NAME_WORDS}")
    return name


def decode_alarm(request: alarm_service_pb2.CreateAlarmRequest) -> FenceConfig:
    """The settings of an alarm."""
    if not request.HasField("rule"):
        raise InvalidFieldError("rule", "", "the rule of the alarm is required")
    rule = request.rule
    which = rule.WhichOneof("hulls")
    if which is None:
        raise InvalidFieldError("rule", "no hulls", "an alarm needs a hull or a prefix")
    if which == "hull":
        hulls = decode_name(rule.hull, "rule.hull")
    elif not NAME_CHARACTERS.fullmatch(rule.prefix):
        raise InvalidFieldError("rule.prefix", rule.prefix, 'names consist of letters, digits and "._-/"')
    else:
        hulls = rule.prefix
    if rule.max_events > LARGEST_INTEGER:
        raise InvalidFieldError("rule.max_events", rule.max_events, f"must be at most {LARGEST_INTEGER}")
    decoded = _decode_rule(rule)
    if which == "hull" and decoded.other == hulls:
        raise InvalidFieldError("rule.when", rule.when, f"must name another hull than {hulls!r}")
    return FenceConfig(
        decoded,
        "other" if which == "hull" else "prefix",
        hulls,
        max_events=rule.max_events,
        max_event_age=_decode_duration(rule, "max_event_age"),
    )


def _decode_rule(rule: alarm_pb2.AlarmRule) -> AlarmRule:
    raises = _decode_condition(rule.when, "rule.when")
    hold = _decode_duration(rule, "hold")
    _require_area(raises, rule.when)
    if raises.measure == SILENT:
        if rule.clear:
            raise InvalidFieldError("rule.clear", rule.clear, "a change of the hull clears an alarm about silence")
        if hold:
            raise InvalidFieldError("rule.hold", rule.hold.ToJsonString(), f"{raises} has a time of its own")
        return AlarmRule(str(raises), "")
    clears = _decode_condition(rule.clear, "rule.clear") if rule.clear else raises.opposite
    if (clears.measure, clears.subject) != (raises.measure, raises.subject):
        what = "measure" if clears.measure != raises.measure else "hull, area or key"
        raise InvalidFieldError("rule.clear", rule.clear, f"must be about the same {what} as {str(raises)!r}")
    if clears.over == raises.over or raises.meets(clears):
        weaker = f"must be weaker than {str(raises)!r}: its opposite, {str(raises.opposite)!r}, or farther from it"
        raise InvalidFieldError("rule.clear", rule.clear, weaker)
    return AlarmRule(str(raises), str(clears), hold)


def _require_area(condition: Condition, text: str) -> None:
    """Refuse an area that is valid neither in the plane nor on the globe."""
    if condition.measure != "vertex in" or isinstance(condition.subject, str):
        return
    problems = []
    for geographic in (False, True):
        try:
            require_area(condition.subject, geographic=geographic)
        except ValueError as error:
            problems.append(str(error))
    if len(problems) > 1:
        raise InvalidFieldError("rule.when", text, problems[0])


def _decode_condition(text: str, field: str) -> Condition:
    try:
        return condition_of(text)
    except ConditionError as error:
        raise InvalidFieldError(field, text, str(error)) from None


def _decode_duration(rule: alarm_pb2.AlarmRule, field: str) -> int:
    return decode_duration(getattr(rule, field), f"rule.{field}", least=0) if rule.HasField(field) else 0

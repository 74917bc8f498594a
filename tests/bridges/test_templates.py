"""Templates of bodies: what they make, what is refused at the start, and that they reach nothing but the event."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from brokers import broker, mosquitto
from cases import slow
from command_line import dynhull
from patience import wait_until
from ports import free_port
from receiver import Receiver
from relay_process import FAST, acknowledged, alarm, fence, grow_and_shrink, relay_process
from server_process import run
from subscriber import Subscriber

from dynhull_bridges.bodies.headers import TemplateHeader
from dynhull_bridges.bodies.template import JSON_TYPE, Template
from dynhull_bridges.letters import letter
from dynhull_bridges.target import RefusedError
from dynhull_bridges.urls import without_secrets
from dynhull_client import AlarmEvent, FenceEvent, HullClient, SubjectsInside

PLAIN = ("--unsigned", "--allow-private", *FAST)
RAISED = AlarmEvent("raised", 3, "spread", "uid", hull="fleet/north", value=12.0, bound=1e7, previous=2.25)
NASTY = '", "admin": true, "x": "\\ \n <!channel> \u2028é😀'
SLACK = """\
{"text": "{% if type == "raised" %}:red_circle:{% else %}:white_circle:{% endif %} {{ alarm }} is {{ type }}"}
"""


def made(text: str, event: AlarmEvent | FenceEvent = RAISED, content_type: str = JSON_TYPE) -> str:
    return Template(text, "body", content_type, ["alarm", "fence"]).text(letter(event))


@pytest.mark.parametrize(
    ("text", "body"),
    [
        ('{"text": "{{ hull }}: {{ value }}"}', {"text": "fleet/north: 12"}),
        ('{"a": {{ hull }}, "b": {{ value }}, "c": {{ cause_time }}}', {"a": "fleet/north", "b": 12.0, "c": None}),
        ('{"a": "{{ cause_time }}", "b": "{{ key | default("none") }}{{ "" | default(1) }}"}', {"a": "", "b": "none1"}),
        ("{{ (bound / 1e6) | round(1) }}", 10.0),
        ('"{{ (previous * 3 - 1) | round }} {{ -previous }}"', "6 -2.25"),
        ('{{ "big" if value > 10 and not key else "small" }}', "big"),
        ('{% if type == "cleared" %}1{% elif kind == "alarm" %}2{% else %}3{% endif %}', 2),
        ('{% if 1 < value <= 12 and value is not none and type in "raised" %}true{% else %}false{% endif %}', True),
        (
            '"{{ name }} {{ event.id }} {{ event.data.sequence }} {{ event.source | upper }}"',
            "spread uid-3 3 /ALARMS/SPREAD",
        ),
        ("{{ event }}", json.loads(letter(RAISED).text) | {"subject": "fleet/north", "time": None}),
        ('"{{ keys | join }}{{ raised | length }}{{ value / 0 }}{{ hull + 1 }}{{ value < hull }}"', "false"),
        ('{{ "\\"" }}', '"'),
        ('{"a": "\\"{{ hull }}\\""}', {"a": '"fleet/north"'}),
        ("{# a comment #}{% raw %}[]{% endraw %}", []),
    ],
)
def test_what_templates_make(text: str, body: Any) -> None:
    assert json.loads(made(text)) == body


def test_text() -> None:
    assert made("{{ alarm }}: {{ hull }}\n", content_type="text/plain") == "spread: fleet/north"


@pytest.mark.parametrize("text", ['{"a": "{{ key }}"}', '{"a": {{ key }}}', '{"a": "{{ key | upper | lower }}"}'])
def test_nothing_of_a_value_leaves_its_quotation_marks(text: str) -> None:
    event = FenceEvent("enter", 1, "yard", "uid", key=NASTY.lower())
    assert json.loads(made(text, event)) == {"a": NASTY.lower()}


def test_slack_gets_no_commands_from_values() -> None:
    event = FenceEvent("enter", 1, "yard", "uid", key="<!channel> & <@U1>")
    assert json.loads(made('"{{ key | slack }}"', event)) == "&lt;!channel&gt; &amp; &lt;@U1&gt;"


def test_lists() -> None:
    event = FenceEvent("snapshot", 1, "yard", "uid", inside=(SubjectsInside("fleet", ("a", 'b"'), 3),))
    text = '{"keys": "{{ inside[0].keys | join("; ") }}", "none": {{ inside[1].keys }}, "all": {{ inside | tojson }}}'
    body = json.loads(made(text, event))
    assert (body["keys"], body["none"]) == ('a; b"', None)
    assert body["all"] == [{"hull": "fleet", "keys": ["a", 'b"'], "revision": 3}]
    nested = json.loads(json.loads(made('"{{ inside | tojson }}"', event)))
    assert nested == body["all"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ('{\n"a": "{{ hul }}"}', "body:2: there is no field 'hul': did you mean 'hull'?"),
        ("{{ event.dta }}", "body:1: there is no field of event 'dta': did you mean 'data'?"),
        ("{{ event.data.valu }}", "body:1: there is no field 'valu': did you mean 'value'?"),
        ("{{ hull.name }}", "body:1: hull is a single value: it has no 'name'"),
        ("{{ position.x }}", "body:1: position is a list: position[0] is its first value"),
        ("{{ value | roound }}", "body:1: there is no filter 'roound': there are default, join"),
        ("{{ value | round(1, 2) }}", "body:1: the filter 'round' takes 1 constant as an argument"),
        ("{{ value | round('x') }}", "body:1: the filter 'round' takes no 'x'"),
        ("\n\n{% if %}", "body:3: Expected an expression"),
        ("{{ value", "body:1: unexpected end of template"),
        ('{"a": {{ value }}', "body: of an event of the type 'raised', the template makes no JSON"),
        (
            '{% if type == "closed" %}{% else %}1{% endif %}',
            "body: of an event of the type 'closed', the template makes",
        ),
        ('"\\{{ hull }}"', "body:1: a backslash before a value"),
        ("{{ 1e999 }}", "body:1: a number is too large"),
        ('"{{ "\\ud800" }}"', "body: of an event of the type 'raised', the template makes half of a character"),
        ("x" * 2**16 + "x", "body: 65537 characters; a template has at most 65536"),
        ("{{ " + "(" * 5000 + "1" + ")" * 5000 + " }}", "body: no template: maximum recursion"),
        ("{{ " + "not " * 500 + "1 }}", "body:1: nested more than 100 times"),
        ("{{ hull" + " | upper" * 500 + " }}", "body:1: nested more than 100 times"),
        ("{% if 1 %}" * 200 + "1" + "{% endif %}" * 200, "body:1: nested more than 100 times"),
        ("{{ " + "9" * 5000 + " }}", "body: no template: Exceeds the limit"),
    ],
)
def test_mistakes_are_named_at_the_start(text: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=r"^body") as caught:
        made(text)
    assert str(caught.value).startswith(complaint)


ATTACKS = [
    "{{ hull.__class__.__mro__ }}",
    "{{ event.__class__ }}",
    "{{ event['__class__'] }}",
    "{{ event.data.__init__ }}",
    "{{ self }}",
    "{{ self.__init__ }}",
    "{{ config }}",
    "{{ lipsum.__globals__ }}",
    "{{ cycler.__init__.__globals__.os.environ }}",
    "{{ request }}",
    "{{ range(10) }}",
    "{{ hull.format(1) }}",
    "{{ event.items() }}",
    "{{ hull | attr('__class__') }}",
    "{{ keys | map('upper') }}",
    "{{ hull | replace('a', 'b') }}",
    "{{ 10 ** 10 ** 10 }}",
    "{{ '%1000000000d' % 1 }}",
    "{{ [1, 2] }}",
    "{{ {'a': 1} }}",
    "{{ hull ~ hull }}",
    "{{ hull[0:1] }}",
    "{{ inside[sequence] }}",
    "{{ loop }}",
    "{% for a in keys %}{% endfor %}",
    "{% set a = 1 %}",
    "{% macro a() %}{% endmacro %}",
    "{% include '/etc/passwd' %}",
    "{% import 'os' as os %}",
    "{% extends 'a' %}",
    "{% block a %}{% endblock %}",
    "{% filter upper %}a{% endfilter %}",
    "{% call a() %}{% endcall %}",
    "{% with a = 1 %}{% endwith %}",
    "{% autoescape true %}{% endautoescape %}",
]


@pytest.mark.parametrize("text", ATTACKS)
def test_templates_reach_nothing_but_the_event(text: str) -> None:
    with pytest.raises(ValueError, match=r"^body:1: "):
        made(text, content_type="text/plain")


@pytest.mark.parametrize("text", ["{{ ''.__class__ }}", "{{ keys[0].__class__ }}", "{{ 'x' * 1000000000 }}"])
def test_what_no_value_of_json_has_is_nothing(text: str) -> None:
    assert made(text, content_type="text/plain") == ""


def test_a_template_that_makes_too_much() -> None:
    event = FenceEvent("snapshot", 1, "yard", "uid", inside=(SubjectsInside("a", ("k" * 200,) * 6000, 1),))
    with pytest.raises(RefusedError, match="makes more than 1048576 characters"):
        made("{{ inside }}", event)


@slow
def test_a_template_that_takes_too_long() -> None:
    event = FenceEvent("snapshot", 1, "yard", "uid", inside=(SubjectsInside("a", ("k" * 200,) * 20_000, 1),))
    begun = time.thread_time()
    with pytest.raises(RefusedError, match="takes more than 1 s"):
        made("{{ inside | tojson | length }}" * 500, event, "text/plain")
    assert time.thread_time() - begun < 30


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("X-A: a\r\nX-B: b", "--header X-A: the value has a line break"),
        ("X-A: a\nX-B: b", "--header X-A: the value has a line break"),
        ("X-A: a\0", "--header X-A: the value has a line break, or another control character"),
        ("X A: a", "--header 'X A': give NAME: VALUE"),
        ("X-A\r: a", "--header 'X-A\\r': give NAME: VALUE"),
        ("secret-value", "--header '': give NAME: VALUE"),
        ("Host: a", "--header Host: the relay sets it"),
        ("Webhook-Id: a", "--header Webhook-Id: the relay sets it"),
        ("Authorization: {{ secret }}", "--header Authorization:1: there is no field 'secret'"),
    ],
)
def test_bad_headers(line: str, complaint: str) -> None:
    with pytest.raises(ValueError, match="--header") as caught:
        TemplateHeader(line, ["fence"])
    assert str(caught.value).startswith(complaint)
    assert "secret-value" not in str(caught.value)


@pytest.mark.parametrize("key", ["a\r\nX-B: b", "a\nb", "a\rb", "\0"])
def test_no_value_begins_another_header(key: str) -> None:
    header = TemplateHeader("Title: of {{ key }}", ["fence"])
    assert header.value(letter(FenceEvent("enter", 1, "yard", "uid", key="k"))) == "of k"
    with pytest.raises(RefusedError, match="the header Title has a line break"):
        header.value(letter(FenceEvent("enter", 1, "yard", "uid", key=key)))


def test_tokens_in_paths_are_not_shown() -> None:
    token = "aB3dE6gH9jK2mN5pQ8sT1vW4"
    shown = without_secrets(f"https://user:word@hooks.slack.com/services/T0/B0/{token}?key=word")
    assert shown.startswith("https://hooks.slack.com/services/T0/B0/…")
    assert token not in shown
    assert shown != without_secrets(f"https://hooks.slack.com/services/T0/B0/{token.lower()}")


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        alarm(client, name)
        yield client


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str], Path]:
    def written(name: str, text: str) -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return written


def test_a_webhook_with_a_template_and_headers(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path, write: Callable[[str, str], Path]
) -> None:
    """A body that is refused becomes a dead letter, and is sent again by the template of that time."""
    template = write("slack.json", SLACK)
    headers = write("headers", "Authorization: Bearer word\n\nX-Title: {{ hull }} is {{ type }}\n")
    given = ("--body-template", template, "--header", f"@{headers}", "--header", "X-One: 1")
    endpoint.answer = lambda request: (400 if "cleared" in request.body else 200, {})
    to = ("--to", endpoint.url)
    with relay_process(address, tmp_path, f"alarm:{name}", *to, *given, *PLAIN, "--attempts", 1) as relay:
        grow_and_shrink(client, name, 1)
        wait_until(lambda: acknowledged(client, name, "alarm") == 2)
        assert "word" not in "".join(relay.lines())
    (raised,) = endpoint.accepted
    assert json.loads(raised.body) == {"text": f":red_circle: {name} is raised"}
    sent = ("content-type", "authorization", "x-title", "x-one")
    assert [raised.headers[each] for each in sent] == [JSON_TYPE, "Bearer word", f"{name} is raised", "1"]
    assert raised.headers["webhook-id"].endswith("-1")
    endpoint.answer = lambda _: (200, {})
    state = ("--state", tmp_path / "relay", "--unsigned", "--allow-private")
    assert run("relay", "dead-letters", "send", *to, *state, "--body-template", template).stdout == "1 sent\n"
    assert json.loads(endpoint.accepted[-1].body) == {"text": f":white_circle: {name} is cleared"}


def test_a_topic_with_a_template(
    client: HullClient, address: str, name: str, tmp_path: Path, write: Callable[[str, str], Path]
) -> None:
    port, template = free_port(), write("body", "[{{ value }}, {{ type }}]")
    with broker(mosquitto(tmp_path, port), port):
        subscriber = Subscriber(port)
        given = ("--to", f"mqtt://127.0.0.1:{port}", "--body-template", template)
        with relay_process(address, tmp_path, f"alarm:{name}", *given, *FAST):
            grow_and_shrink(client, name, 1)
            wait_until(lambda: len(subscriber.messages) == 2)
    assert [body for _, body in subscriber.messages] == [[12.0, "raised"], [2.0, "cleared"]]


def test_a_header_that_a_key_would_break_is_a_dead_letter(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    fence(client, f"{name}/of")
    to = ("--to", endpoint.url, "--header", "X-Key: {{ key }}", "--attempts", 1, *PLAIN)
    with relay_process(address, tmp_path, f"{name}/of", *to):
        client.put(f"{name}/of", ["a\r\nX-Evil: 1", "b"], [[1, 1], [1, 1]])
        wait_until(lambda: acknowledged(client, f"{name}/of") == 2)
    assert [request.headers["x-key"] for request in endpoint.received] == ["b"]
    assert "x-evil" not in endpoint.received[0].headers


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--to", "http://a.example"], "body.json:1: there is no field 'hul': did you mean 'hull'?"),
        (["--to", "http://a.example", "--content-type", "json"], "--content-type 'json' is no media type"),
        (["--to", "events"], None),
        (["--to", "http://a.example", "--batch", 2], None),
        (["--to", "mqtt://a", "--header", "A: b"], "--header is for webhooks"),
    ],
)
def test_bad_options(
    options: list[object], complaint: str | None, tmp_path: Path, write: Callable[[str, str], Path]
) -> None:
    good = complaint is None or "--header" in complaint
    template = write("body.json", '"{{ hull }}"' if good else '"{{ hul }}"')
    common = ("--consumer", "test", "--state", tmp_path, "--address", "127.0.0.1:1", "--unsigned")
    done = dynhull("relay", "alarm:a", *common, "--body-template", template, *options)
    assert done.exit_code == 2
    assert (complaint or "--body-template is for single events to URLs") in done.stderr

"""The files in deploy/: the tools that read them accept them, and every metric that they name exists."""

import json
import re
import subprocess
from pathlib import Path

import pytest
import yaml
from cases import slow
from forked import COMMAND
from metrics import fetch, measured
from patience import PATIENCE
from peers import program
from relay_process import relay_process

from dynhull_client import HullClient

KIT = Path(__file__).parents[2] / "deploy"
NAME = re.compile(r"\b(?:dynhull|process)_[a-z_]+")


def accepted(*command: str | Path) -> str:
    """The output of a program of Debian, which must exit with code 0."""
    ended = subprocess.run(
        [program(command[0]), *command[1:]], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def expressions() -> list[str]:
    """Of the Grafana dashboard, with its variables filled in."""
    panels = json.loads((KIT / "grafana/dynhull.json").read_text())["panels"]
    found = [target["expr"] for panel in panels for target in panel.get("targets", [])]
    return [each.replace("$__rate_interval", "5m").replace("$instance", ".*").replace("$hull", ".*") for each in found]


def test_prometheus_takes_the_configuration() -> None:
    accepted("promtool", "check", "config", KIT / "prometheus/prometheus.yml")


@slow
def test_alerts_fire_on_what_they_are_for() -> None:
    accepted("promtool", "test", "rules", KIT / "prometheus/alerts_test.yml")


def test_prometheus_understands_the_grafana_dashboard(tmp_path: Path) -> None:
    rules = [{"record": f"panel:{i}", "expr": expression} for i, expression in enumerate(expressions())]
    file = tmp_path / "panels.yml"
    file.write_text(json.dumps({"groups": [{"name": "panels", "rules": rules}]}))  # JSON is YAML
    assert f"{len(rules)} rules found" in accepted("promtool", "check", "rules", file)


def test_what_is_asked_for_is_there(tmp_path: Path) -> None:
    with measured("--metrics-prefix", "") as (server, address), HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=[[0, 0]])
        with client.watch("a") as watch:
            next(watch)
            there = {*NAME.findall(fetch(f"http://{address}/metrics"))}
    with relay_process("127.0.0.1:1", tmp_path, "a", "--to", "-", "--metrics-port", 0) as relay:
        port = relay.wait_for("relaying")["metrics_port"]
        there |= {*NAME.findall(fetch(f"http://127.0.0.1:{port}/metrics"))}
    asked = {*NAME.findall("\n".join(expressions())), *NAME.findall((KIT / "prometheus/alerts.yml").read_text())}
    assert len(asked) > 10
    assert asked <= there


def test_kubernetes_takes_the_pods_of_ray() -> None:
    """The kind itself is KubeRay's; what it makes of the templates is of Kubernetes."""
    import kubernetes_validate  # each worker of the tests imports this file, and one runs it

    *others, cluster = yaml.safe_load_all((KIT / "kuberay/raycluster.yaml").read_text())
    groups = [cluster["spec"]["headGroupSpec"], *cluster["spec"]["workerGroupSpecs"]]
    templates = [
        {"apiVersion": "v1", "kind": "PodTemplate", "metadata": {"name": "node"}, "template": group["template"]}
        for group in groups
    ]
    for each in (*others, *templates):
        kubernetes_validate.validate(each, kubernetes_validate.latest_version(), strict=True)
    templates[1]["template"]["spec"]["container"] = []
    with pytest.raises(kubernetes_validate.ValidationError, match="container"):
        kubernetes_validate.validate(templates[1], kubernetes_validate.latest_version(), strict=True)


@pytest.mark.parametrize("unit", [*KIT.glob("*.service")], ids=lambda path: path.name)
def test_systemd_takes_the_unit(unit: Path, tmp_path: Path) -> None:
    installed = tmp_path / unit.name
    installed.write_text(unit.read_text().replace("/opt/dynhull/bin/dynhull", COMMAND))
    assert COMMAND in installed.read_text()
    accepted("systemd-analyze", "verify", installed)

"""Kubernetes manifests of a run: a pod with a certificate for each service, reachable only from the other services.

    lapwing certificates keys
    python deploy/kubernetes.py delivery_mission | kubectl apply -f -

See docs/guides/several_hosts.md.
"""

import argparse
import json
from typing import Any

from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.services import process_table
from lapwing.services.scene_resolver import load, resolve

NAMESPACE, PORT, USER = "lapwing", 7447, 1000
RECORDINGS = {"name": "recordings", "mountPath": "/app/recordings"}
MEMORY = {"recorder": "2Gi", MONITOR: "2Gi"}  # limit; 1 GiB for all others
LABELS = {"app.kubernetes.io/part-of": NAMESPACE}


def manifests(scene: str, image: str) -> list[dict[str, Any]]:
    """Return all objects of a run of a scene."""
    names = [*process_table.required_processes(resolve(load(scene))), MONITOR]
    table = ",".join(f"{name}=tls/{name}:{PORT}" for name in names)
    result: list[dict[str, Any]] = [
        {
            "apiVersion": "v1",
            "kind": "Namespace",
            "metadata": {"name": NAMESPACE, "labels": {"pod-security.kubernetes.io/enforce": "restricted"}},
        },
        {
            "apiVersion": "v1",
            "kind": "PersistentVolumeClaim",
            "metadata": _metadata("recordings"),
            "spec": {"accessModes": ["ReadWriteMany"], "resources": {"requests": {"storage": "10Gi"}}},
        },
        _policy(),
    ]
    for name in names:
        result += [_service(name), _pod(name, scene, table, image)]
    return result


def _metadata(name: str) -> dict[str, Any]:
    return {"name": name, "namespace": NAMESPACE, "labels": {**LABELS, "app.kubernetes.io/name": name}}


def _policy() -> dict[str, Any]:
    """Return the network policy: pods of a run only reach each other's port and the cluster's name service."""
    ours = {"podSelector": {"matchLabels": LABELS}}
    at = [{"protocol": "TCP", "port": PORT}]
    names = [{"protocol": protocol, "port": 53} for protocol in ("UDP", "TCP")]
    return {
        "apiVersion": "networking.k8s.io/v1",
        "kind": "NetworkPolicy",
        "metadata": _metadata("participants"),
        "spec": {
            "podSelector": {},
            "policyTypes": ["Ingress", "Egress"],
            "ingress": [{"from": [ours], "ports": at}],
            "egress": [{"to": [ours], "ports": at}, {"to": [{"namespaceSelector": {}}], "ports": names}],
        },
    }


def _service(name: str) -> dict[str, Any]:
    return {
        "apiVersion": "v1",
        "kind": "Service",
        "metadata": _metadata(name),
        "spec": {
            "clusterIP": "None",
            "publishNotReadyAddresses": True,  # the participants wait for one another before they are ready
            "selector": {**LABELS, "app.kubernetes.io/name": name},
            "ports": [{"name": "zenoh", "port": PORT}],
        },
    }


def _pod(name: str, scene: str, table: str, image: str) -> dict[str, Any]:
    log = ["--log", "recordings/flight.mcap"]
    command = {
        MONITOR: ["lapwing", "run", scene, *log, "--json", "recordings/flight.json"],
        process_table.RECORDER: ["lapwing", "service", name, scene, *log],
    }.get(name, ["lapwing", "service", name, scene])
    writes = name in (MONITOR, process_table.RECORDER)
    keys = {"name": "keys", "mountPath": f"/app/keys/{name}"}
    restricted = {"allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]}}
    resources = {"requests": {"cpu": "250m", "memory": "512Mi"}, "limits": {"memory": MEMORY.get(name, "1Gi")}}
    volumes: list[dict[str, Any]] = [
        {"name": "secret", "secret": {"secretName": f"keys-{name}"}},
        {"name": "keys", "emptyDir": {"medium": "Memory", "sizeLimit": "1Mi"}},
        {"name": "tmp", "emptyDir": {"medium": "Memory", "sizeLimit": "256Mi"}},
    ]
    if writes:
        volumes.append({"name": "recordings", "persistentVolumeClaim": {"claimName": "recordings"}})
    return {
        "apiVersion": "v1",
        "kind": "Pod",
        "metadata": _metadata(name),
        "spec": {
            "hostname": name,  # so that it can listen on its name immediately
            "restartPolicy": "Never",
            "automountServiceAccountToken": False,
            "enableServiceLinks": False,
            "securityContext": {
                "runAsNonRoot": True,
                "runAsUser": USER,
                "runAsGroup": USER,
                "fsGroup": USER,
                "seccompProfile": {"type": "RuntimeDefault"},
            },
            # files of a secret are readable by the group, and Lapwing rejects such keys
            "initContainers": [
                {
                    "name": "keys",
                    "image": image,
                    "command": ["sh", "-c", f"install --mode 600 --target-directory {keys['mountPath']} /secret/*.pem"],
                    "securityContext": restricted,
                    "resources": {**resources, "limits": {"memory": "64Mi"}, "requests": {"memory": "64Mi"}},
                    "volumeMounts": [{"name": "secret", "mountPath": "/secret", "readOnly": True}, keys],
                }
            ],
            "containers": [
                {
                    "name": name,
                    "image": image,
                    "args": [*command, "--endpoints", table, "--keys", "keys"],
                    "securityContext": restricted,
                    "resources": resources,
                    "ports": [{"name": "zenoh", "containerPort": PORT}],
                    "readinessProbe": {"tcpSocket": {"port": PORT}, "periodSeconds": 10},
                    "volumeMounts": [
                        {**keys, "readOnly": True},
                        {"name": "tmp", "mountPath": "/tmp"},
                        *([RECORDINGS] if writes else []),
                    ],
                }
            ],
            "volumes": volumes,
        },
    }


def main() -> None:
    """Print the manifests as JSON, which kubectl accepts like YAML."""
    parser = argparse.ArgumentParser(description="Kubernetes manifests of a run: one pod for each service.")
    parser.add_argument("scene", help="name of a shipped scene")
    parser.add_argument("--image", default="lapwing:latest")
    options = parser.parse_args()
    try:
        items = manifests(options.scene, options.image)
    except ValueError as error:
        parser.exit(2, f"kubernetes.py: {error}\n")
    print(json.dumps({"apiVersion": "v1", "kind": "List", "items": items}, indent=2))


if __name__ == "__main__":
    main()

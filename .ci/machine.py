"""Settings of apt and pip on this machine, for a root that installs from the same places.

``python3 .ci/machine.py mirror|apt|pip|paths|network``: the distribution's mirror and suite; apt's and pip's settings
as a file; the files and folders these name, one a line; variables about proxies and certificates, one a line.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

# What says where from and how to install; anything else is this machine's affair.
PIP = (
    "index-url",
    "extra-index-url",
    "find-links",
    "no-index",
    "trusted-host",
    "cert",
    "client-cert",
    "proxy",
    "timeout",
    "default-timeout",
    "retries",
)
APT = re.compile(r"Acquire::(http|https|Check-Date|Check-Valid-Until|Languages|Retries)\b")
CERTIFICATES = ("SSL_CERT_FILE", "REQUESTS_CA_BUNDLE")
PROXIES = ("http_proxy", "https_proxy", "no_proxy", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY")


def output(*command: str) -> list[str]:
    """Lines that a command printed; none where it is missing or fails."""
    try:
        run = subprocess.run(command, capture_output=True, encoding="utf-8", check=True)  # noqa: S603 - all constant
    except (OSError, subprocess.CalledProcessError):
        return []
    return run.stdout.splitlines()


def mirror() -> list[str]:
    """The mirror and suite, "http://... bookworm"; a suite with a dash holds updates only."""
    found = (re.match(r"'(.+)/dists/([a-z]+)/InRelease'", line) for line in output("apt-get", "update", "--print-uris"))
    return [f"{match[1]} {match[2]}" for match in found if match][:1]


def apt() -> list[str]:
    """What apt is told about fetching."""
    return [line for line in output("apt-config", "dump") if APT.match(line)]


def pip_settings() -> dict[str, str]:
    """Pip's settings by name; the environment comes last in pip's list and wins, as it does in pip."""
    found = {}
    for line in output(sys.executable, "-m", "pip", "config", "list"):
        name, _, value = line.partition("=")
        if (key := name.rpartition(".")[2]) in PIP:
            found[key] = str(ast.literal_eval(value))
    return found


def pip() -> list[str]:
    """A ``pip.conf``."""
    return ["[global]", *(f"{key} = {' '.join(value.split())}" for key, value in pip_settings().items())]


def paths() -> list[str]:
    """Files and folders on the disk that pip's settings and the variables name, and how names are resolved."""
    found = [Path("/etc/resolv.conf"), Path("/etc/hosts"), *(Path(os.environ.get(name, "")) for name in CERTIFICATES)]
    for key, value in pip_settings().items():
        for word in value.split():
            if word.startswith("/"):
                found.append(Path(word))
            elif word.startswith("file:"):
                folder = Path(unquote(urlsplit(word).path))
                # An index is a folder of links to files beside it.
                found.append(folder.parent if key.endswith("index-url") else folder)
    return sorted({str(path) for path in found if path.is_absolute() and path.exists()})


def network() -> list[str]:
    """Variables as they are; a proxy that only apt knows counts too."""
    known = {name: os.environ[name] for name in (*CERTIFICATES, *PROXIES) if os.environ.get(name)}
    for name in ("http", "https"):
        for line in output("apt-config", "dump", "--no-empty", "--format", "%v%n", f"Acquire::{name}::Proxy"):
            known.setdefault(f"{name}_proxy", line)
    return [f"{name}={value}" for name, value in known.items()]


if __name__ == "__main__":
    lines = {"mirror": mirror, "apt": apt, "pip": pip, "paths": paths, "network": network}[sys.argv[1]]()
    print("\n".join(lines))

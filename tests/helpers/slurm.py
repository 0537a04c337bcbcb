"""A Slurm of two nodes on this machine for tests: its own configuration, ports and daemons, nothing of the system's."""

import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

SBIN = "/usr/sbin"
NODES = ("node1", "node2")
ENDED = "ended.txt"
"""The file in which Slurm keeps a line about each job that has ended."""


def missing() -> str:
    """Why there cannot be one here; empty if there can."""
    if any(shutil.which(name, path=f"{SBIN}:/usr/bin") is None for name in ("slurmctld", "slurmd", "srun", "squeue")):
        return "needs Slurm's daemons and commands: Debian's package slurm-wlm"
    return "" if os.geteuid() == 0 else "needs to be root, as slurmd does"


def configuration(root: Path, spool: str) -> str:
    """Two nodes with three processors each, whatever there is; nothing listens but on this machine."""
    host = socket.gethostname().split(".")[0]
    controller, *nodes = free_ports(1 + len(NODES))
    lines = [
        "ClusterName=test",
        f"SlurmctldHost={host}(127.0.0.1)",
        f"SlurmctldPort={controller}",
        "SlurmUser=root",
        "SlurmdUser=root",
        "AuthType=auth/none",
        "CredType=cred/none",
        f"StateSaveLocation={root}/state",
        f"SlurmdSpoolDir={spool}/%n",
        f"SlurmctldPidFile={root}/slurmctld.pid",
        f"SlurmdPidFile={root}/slurmd-%n.pid",
        f"SlurmctldLogFile={root}/slurmctld.log",
        f"SlurmdLogFile={root}/slurmd-%n.log",
        "ProctrackType=proctrack/linuxproc",
        "TaskPlugin=task/none",
        "SelectType=select/cons_tres",
        "SelectTypeParameters=CR_Core",
        "AccountingStorageType=accounting_storage/none",
        "JobCompType=jobcomp/filetxt",
        f"JobCompLoc={root}/{ENDED}",
        "SlurmdParameters=config_overrides",
        "JobAcctGatherType=jobacct_gather/none",
        "SwitchType=switch/none",
        "MpiDefault=none",
        "ReturnToService=2",
        "KillWait=1",
        "SchedulerParameters=sched_interval=2,batch_sched_delay=0",
        "CommunicationParameters=NoCtldInAddrAny,NoInAddrAny",
        *(
            f"NodeName={name} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=3 RealMemory=500 State=UNKNOWN"
            for name, port in zip(NODES, nodes, strict=True)
        ),
        "PartitionName=all Nodes=ALL Default=YES MaxTime=60 State=UP",
    ]
    return "\n".join(lines) + "\n"


def free_ports(count: int) -> list[int]:
    """Ports of this machine that nobody listens to."""
    with ExitStack() as opened:
        found = [opened.enter_context(socket.socket()) for _ in range(count)]
        for one in found:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in found]


@contextmanager
def running_slurm(root: Path) -> Iterator[dict[str, str]]:
    """The environment in which Slurm's commands talk to a Slurm that runs in `root`; it ends with the context."""
    (root / "state").mkdir(parents=True)
    file = root / "slurm.conf"
    # slurmd's sockets are there, whose names may have 107 characters.
    spool = tempfile.mkdtemp(prefix="slurm-")
    file.write_text(configuration(root, spool))
    environment = {**os.environ, "SLURM_CONF": str(file)}
    daemons = [
        subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for command in (
            [f"{SBIN}/slurmctld", "-D", "-i", "-f", file],
            *([f"{SBIN}/slurmd", "-D", "-f", file, "-N", name] for name in NODES),
        )
    ]
    try:
        deadline = time.monotonic() + 30
        while states(environment) != ["idle"] * len(NODES):
            assert time.monotonic() < deadline, "\n".join(path.read_text() for path in root.glob("*.log"))
            time.sleep(0.2)
        yield environment
    finally:
        slurm(environment, "scancel", "--user", "root")
        deadline = time.monotonic() + 10
        while slurm(environment, "squeue", "--noheader") and time.monotonic() < deadline:
            time.sleep(0.2)
        for daemon in reversed(daemons):
            daemon.terminate()
        for daemon in daemons:
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        shutil.rmtree(spool, ignore_errors=True)


def states(environment: dict[str, str]) -> list[str]:
    """The state of each node."""
    found = slurm(environment, "sinfo", "--Node", "--noheader", "--format=%T")
    return found.split()


def slurm(environment: dict[str, str], *command: str) -> str:
    """What a command of Slurm's prints; nothing if the daemon does not answer."""
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=30, check=False).stdout

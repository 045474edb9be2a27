"""`serd launch` with a fault: when it ends, which node it names, and what it leaves behind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

_SERD = str(Path(sys.executable).with_name("serd"))
_PATIENCE_S = 240.0
#: What a node writes to its log when its stack works; the first of these nodes counts.
_WORKING = {
    "scripted_expert": "episode 1 of",
    "teleop_page": "the world is running",
    "strategy": "strategy |",
    "learner": "decisions",
    "hallway_sim": "commands come from",
}


@dataclass(frozen=True)
class Ending:
    """after_s: until `serd launch` or, when it was killed, its last node had ended, or until it had
    named a stopped node; wall time.

    named: whether its output names the node and the signal. n_left: nodes that still run 2 s after
    `serd launch` has ended, or while a node is stopped.
    """

    after_s: float
    named: bool
    n_left: int


class LaunchedStack:
    """Runs `serd launch STACK ...`; its output goes to launch.log in the folder."""

    def __init__(
        self, stack: str, given: Sequence[str], environment: Mapping[str, str], folder: Path
    ) -> None:
        self._log, self._domain = folder / "launch.log", environment["ROS_DOMAIN_ID"]
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                [_SERD, "launch", stack, *given],
                cwd=folder,
                env=environment,
                stdout=log,
                stderr=log,
            )

    def wait_until_running(self, nodes: Sequence[str], folder: Path) -> None:
        """Until all nodes run and one of them has written that the stack works."""
        mark = next(mark for node, mark in _WORKING.items() if node in nodes)
        if {"learner", "scripted_expert"} <= set(nodes):
            mark = "episode 2 of"  # so that the learner may have a checkpoint

        def works() -> bool:
            output = self.output()
            if self.process.poll() is not None:
                raise RuntimeError(f"serd launch must run, it ended: {output}")
            return set(nodes) <= set(self.nodes()) and mark in output

        if not self._until(works, _PATIENCE_S):
            raise RuntimeError(f"the nodes {nodes} must run, see {folder}: {self.output()}")

    def output(self) -> str:
        """What it has printed."""
        return self._log.read_text(errors="replace")

    def kill(self) -> Ending:
        """SIGKILL `serd launch` itself; the nodes must end."""
        since_s = time.monotonic()
        self.process.kill()
        self.process.wait()
        n_left = self._left_after(_PATIENCE_S)
        return Ending(time.monotonic() - since_s, False, n_left)

    def kill_node(self, node: str) -> Ending:
        """SIGKILL a node; the others must end."""
        since_s = time.monotonic()
        os.kill(self.nodes()[node], signal.SIGKILL)
        self.process.wait(_PATIENCE_S)
        after_s = time.monotonic() - since_s
        named = f"{node} was killed by signal 9" in self.output()
        return Ending(after_s, named, self._left_after(2.0))

    def stop_node(self, node: str) -> Ending:
        """SIGSTOP a node until it is named, then continue it; all must still run."""
        since_s, pid = time.monotonic(), self.nodes()[node]
        os.kill(pid, signal.SIGSTOP)
        named = self._until(lambda: f"{node} was stopped by a signal" in self.output(), _PATIENCE_S)
        after_s = time.monotonic() - since_s
        os.kill(pid, signal.SIGCONT)
        return Ending(after_s, named, len(self.nodes()))

    def end(self) -> None:
        """Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(_PATIENCE_S)

    def nodes(self) -> dict[str, int]:
        """Names and process ids of the running nodes in the domain of this stack."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                words = (entry / "cmdline").read_text().split("\0")
                environment = (entry / "environ").read_text().split("\0")
            except OSError:
                continue
            if "--ros-args" in words and f"ROS_DOMAIN_ID={self._domain}" in environment:
                program = words[words.index("--ros-args") - 1]
                found[Path(program).name] = int(entry.name)
        return found

    def _left_after(self, duration_s: float) -> int:
        self._until(lambda: not self.nodes(), duration_s)
        return len(self.nodes())

    def _until(self, condition: Callable[[], object], limit_s: float) -> bool:
        end_s = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            time.sleep(0.02)
        return True

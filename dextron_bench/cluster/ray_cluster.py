"""Tasks on Ray, on this machine or on many; the only importer of Ray, which is in the extra `cluster`."""

from __future__ import annotations

import importlib
import importlib.util
import os
import pickle
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, chdir, contextmanager, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

from dextron_bench.cluster import inputs, installation, worker
from dextron_bench.cluster.tasks import BadCluster, OtherVersion, PieceFailed, Reply, Task, write_files
from dextron_bench.storage.progress import Progress, no_progress

LOCAL, AUTO, REMOTE = "local", "auto", "ray://"
TOKEN = "~/.ray/auth_token"  # Ray's, which a cluster with authentication asks for.
TOKENS = ("RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH")  # Variables with a token, and with the file of one.
START = "start one with `ray start --head`, or use --cluster local"
SETTINGS = {  # Of Ray, unless the user sets others.
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    "RAY_raylet_start_wait_time_s": "300",  # A busy machine starts slowly.
    "RAY_agent_register_timeout_ms": "300000",
    "RAY_worker_niceness": "0",  # With Ray's 15, tasks hardly get a processor beside other work.
}
WAITING = 2.0  # Tasks in the cluster for each that can run, so that no processor waits for the driver.
PERIOD = 1.0  # [s] at most until nodes that have joined get tasks.
SETTLING = 2.0  # [s] after a loss: Ray 2.60 can crash if it is left while it hears of a lost node.
LOSSES = 5  # A piece that has lost so many nodes is given up.
PERFORM = worker.perform  # What every task calls on its node.

Next = Callable[[int], Task | None]  # Receives how many tasks are under way.
Done = Callable[[Task], bool]  # Receives a task whose files are written; if True, the work is done.


def check_flag(text: str) -> None:
    """Raises BadCluster if a text names no cluster, or if Ray is not installed; imports nothing."""
    if text not in (LOCAL, AUTO) and not text.startswith(REMOTE):
        raise BadCluster(f"--cluster {text!r} is none of local, auto and ray://HOST:PORT")
    if importlib.util.find_spec("ray") is None:
        raise BadCluster("--cluster needs Ray: `pip install 'dextron-bench[cluster]'`")


class RayCluster:
    """A connection to Ray, for the tasks of one command, whose files are written below a folder of runs.

    `losses` counts the tasks that were done again because their node was lost.
    """

    def __init__(self, address: str, runs: Path, threads: int = 0) -> None:
        check_flag(address)
        self.threads = threads or 1  # Of a task: one uses the processors best.
        self.losses = 0
        self.runs, self._address = runs, address
        self._under_way: dict[Any, Task] = {}
        self._lost: dict[str, int] = {}  # By name of the task: how many nodes it has lost.

    def __enter__(self) -> RayCluster:
        for name, value in SETTINGS.items():
            os.environ.setdefault(name, value)
        if self._address.startswith(REMOTE) and os.path.exists(os.path.expanduser(TOKEN)):
            os.environ.setdefault("RAY_AUTH_MODE", "token")  # Only nodes of a cluster find out by themselves.
        self._ray = importlib.import_module("ray")
        with ExitStack() as quiet:
            quiet.enter_context(_without_messages())
            if self._address == LOCAL:
                quiet.enter_context(_token_without_home())
            empty = quiet.enter_context(TemporaryDirectory(prefix="dextron-ray-", ignore_cleanup_errors=True))
            with chdir(empty):  # Ray's workers search the working folder for modules, before all others.
                self._connect()
            self._quiet = quiet.pop_all()
        self._perform = self._ray.remote(PERFORM)
        self._inputs = inputs.References(self._ray.put)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        with self._quiet:
            if self.losses:
                time.sleep(SETTLING)
            self._ray.shutdown()

    def run(self, next_task: Next, done: Done, waiting: Callable[[], None] = lambda: None) -> None:
        """Does all tasks that `next_task` returns, until it returns None while none is under way.

        `waiting` is called each PERIOD. The tasks of a node that is lost are done again. If the work ends early, by
        `done` or an error, the tasks under way are cancelled. Raises PieceFailed, OtherVersion, BadCluster,
        DamagedFile.
        """
        again: deque[Task] = deque()
        try:
            while self._fill(next_task, again):
                waiting()
                for task, reply in self._replies():
                    if reply is None:
                        again.append(task)
                        continue
                    write_files(reply.files, self.runs)
                    if done(task):
                        return
        finally:
            self._cancel()

    def run_all(self, tasks: Sequence[Task], progress: Progress = no_progress) -> None:
        """Does tasks; `progress` receives how many are done. Raises the errors of `run`."""
        left, count = deque(tasks), 0

        def done(_: Task) -> bool:
            nonlocal count
            count += 1
            report()
            return False

        def report() -> None:
            progress(count, len(tasks))

        self.run(lambda _: left.popleft() if left else None, done, report)

    def _fill(self, next_task: Next, again: deque[Task]) -> bool:
        """Submits tasks while there is room, the tasks of lost nodes first; False if none is under way then."""
        room = self._room()
        while len(self._under_way) < room:
            task = again.popleft() if again else next_task(len(self._under_way))
            if task is None:
                break
            self._submit(task)
        return bool(self._under_way)

    def _connect(self) -> None:
        """Starts Ray on this machine, or connects to a cluster; raises BadCluster."""
        quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "CRITICAL"}
        try:
            if self._address == LOCAL:
                self._ray.init("local", include_dashboard=False, **quiet)
            else:
                self._ray.init(self._address, **quiet)
        except ConnectionError as error:
            why = START if self._address == AUTO else " ".join(str(error).split())
            raise BadCluster(f"no cluster answers to --cluster {self._address}: {why}") from error

    def _room(self) -> int:
        """How many tasks to have in the cluster at once; raises BadCluster if no node has the processors of a task."""
        processors = [node["Resources"].get("CPU", 0.0) for node in self._ray.nodes() if node["Alive"]]
        if max(processors, default=0.0) < self.threads and sum(processors):
            raise BadCluster(
                f"a task needs {self.threads} processors, and the largest node has {max(processors):.0f}: use a "
                "smaller --threads"
            )
        return max(1, int(WAITING * sum(number // self.threads for number in processors)))

    def _cancel(self) -> None:
        """Cancels the tasks under way."""
        for reference in self._under_way:
            self._ray.cancel(reference)
        self._under_way.clear()

    def _submit(self, task: Task) -> None:
        """Sends a task to the cluster. Ray itself never tries again: only the driver knows why a task ended."""
        hashes = {place: self._inputs.sha256(file) for place, file in task.inputs.items()}
        contents = [self._inputs.reference(file) for file in task.inputs.values()]
        options = {"num_cpus": task.threads, "num_gpus": task.gpus, "max_retries": 0, "name": task.name}
        perform = self._perform.options(**options)
        reference = perform.remote(installation.version(), pickle.dumps(task), hashes, *contents)
        self._under_way[reference] = task

    def _replies(self) -> Iterator[tuple[Task, Reply | None]]:
        """Waits for tasks that have ended; yields them with their replies, None if the node was lost."""
        ready, _ = self._ray.wait(list(self._under_way), timeout=PERIOD)
        for reference in ready:
            task = self._under_way.pop(reference)
            yield task, self._reply(task, reference)

    def _reply(self, task: Task, reference: Any) -> Reply | None:
        """The reply of a task that has ended. Raises OtherVersion and PieceFailed."""
        errors = self._ray.exceptions
        try:
            reply: Reply = self._ray.get(reference)
        except (errors.NodeDiedError, errors.ObjectLostError) as error:
            self.losses += 1
            self._lost[task.name] = self._lost.get(task.name, 0) + 1
            if self._lost[task.name] >= LOSSES:
                raise PieceFailed(task.name, f"{LOSSES} nodes were lost while they did it") from error
            return None
        except errors.WorkerCrashedError as error:
            raise PieceFailed(task.name, "its process crashed; it is not tried again") from error
        except errors.RayError as error:
            raise PieceFailed(task.name, " ".join(str(error).split())) from error
        return self._checked(task, reply)

    def _checked(self, task: Task, reply: Reply) -> Reply:
        """The reply, if it has files. Raises OtherVersion and PieceFailed."""
        if reply.is_refusal:
            raise OtherVersion(reply.error)
        if reply.error:
            raise PieceFailed(task.name, reply.error, reply.node) from RemoteError(reply.traceback)
        return reply


class RemoteError(Exception):
    """The traceback of an error on a node, as the cause of the driver's error."""


@contextmanager
def _token_without_home() -> Iterator[None]:
    """A token for Ray on this machine, where Ray cannot write one into the home folder of the user."""
    home = Path(os.path.expanduser("~"))
    if any(name in os.environ for name in TOKENS) or (home.is_absolute() and os.access(home, os.W_OK)):
        yield
        return
    os.environ[TOKENS[0]] = secrets.token_hex(32)
    try:
        yield
    finally:
        os.environ.pop(TOKENS[0], None)


@contextmanager
def _without_messages() -> Iterator[None]:
    """Keeps Ray's messages out of the results: its threads print about lost nodes and processes on stdout."""
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        yield

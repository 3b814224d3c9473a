"""The building blocks of commands, also of other distributions (``eutree.commands`` in ``main``).

Independent work of a command runs in processes here, or on a Dask or Ray cluster that the user has
started and names. None is started here: its scheduler would obey any process of this machine, and
its dashboard would listen to the network, for the sake of work that the processes of joblib do as
well.
"""

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import click

from eutree.cli._options import as_json as json_option
from eutree.cli._options import count as count_option
from eutree.cli._options import environment as env_arg_option
from eutree.cli._options import module as import_option
from eutree.cli._options import output as output_option
from eutree.cli._options import refuse, together
from eutree.cli._options import seed as seed_option
from eutree.cli._output import Output, ProgressLine
from eutree.errors import InvalidArgumentError, MissingExtraError, needed

__all__ = [
    "Output", "ProgressLine", "cluster", "count_option", "env_arg_option", "import_option",
    "json_option", "output_option", "refuse", "seed_option", "workers_options",
]  # fmt: skip

_Command = TypeVar("_Command", bound=Callable[..., Any])

PATIENCE = 10.0  # s, for a scheduler that does not answer
WORKERS_START = 60  # s, for the first worker to be there


def workers_options(of_what: str) -> Callable[[_Command], _Command]:
    """Return ``--n-jobs``, ``--backend`` and ``--address``, of the work that is divided."""
    return together(
        click.option(
            "--n-jobs", type=int, default=-1, show_default=True,
            help=f"Processes for {of_what}; -1 for all cores. The result does not depend on it.",
        ),
        click.option(
            "--backend", type=click.Choice(["loky", "dask", "ray"]), default="loky",
            show_default=True,
            help="What runs the processes: this machine (loky), or the cluster at --address.",
        ),
        click.option(
            "--address",
            help="Scheduler of the cluster, or the file that --scheduler-file of dask wrote; "
            "auto for Ray on this machine. Without, this machine does the work.",
        ),
    )  # fmt: skip


@contextmanager
def cluster(backend: str, address: str | None) -> Iterator[None]:
    """Send joblib's tasks to a cluster while the context lasts; without an address, nowhere.

    Raises:
        InvalidArgumentError: There is no such cluster.
        MissingExtraError: Dask or Ray is not installed.
    """
    if backend == "loky" and address is not None:
        raise InvalidArgumentError("--address is of a cluster: --backend dask or ray")
    if address is None:
        yield
        return
    import joblib

    if backend == "dask":
        options = {"backend": "dask", "wait_for_workers_timeout": WORKERS_START}
        with _dask_client(address), joblib.parallel_config(**options):
            yield
    else:
        _join_ray(address)
        with joblib.parallel_config(backend="ray"):
            yield


def _dask_client(address: str) -> Any:
    with needed("dask.distributed", "cluster"):
        from distributed import Client
    is_file = address.endswith(".json")
    end = time.monotonic() + PATIENCE
    try:
        # A scheduler that has just been started has yet to write its file.
        while is_file and not Path(address).exists():
            if time.monotonic() > end:
                raise TimeoutError("there is no such file")
            time.sleep(0.05)
        return Client(**{"scheduler_file" if is_file else "address": address}, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(
            "--address must be that of a running scheduler, such as tcp://10.0.0.1:8786, or the "
            f"file that it wrote, got {address!r}: {error}"
        ) from error


def _join_ray(address: str) -> None:
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        if port.isdecimal():  # not auto; where nobody answers Ray itself would wait minutes
            socket.create_connection((host, int(port)), timeout=PATIENCE).close()
        import ray
        from ray.util.joblib import register_ray

        ray.init(address=address, ignore_reinit_error=True, log_to_driver=False)
    except ImportError:
        raise MissingExtraError("ray", "") from None
    except (OSError, OverflowError, ValueError) as error:
        raise InvalidArgumentError(
            f"--address must be that of a running Ray cluster, or auto, got {address!r}: {error}"
        ) from error
    register_ray()

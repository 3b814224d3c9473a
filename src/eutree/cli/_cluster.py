"""Where the processes of a command run: here, or on a Dask or Ray cluster."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import click

from eutree.errors import MissingExtraError

_Command = TypeVar("_Command", bound=Callable[..., Any])


def cluster_options(command: _Command) -> _Command:
    """Add ``--backend`` and ``--address``."""
    backend = click.option(
        "--backend",
        type=click.Choice(["loky", "dask", "ray"]),
        default="loky",
        show_default=True,
        help="What runs the processes.",
    )
    address = click.option("--address", help="Scheduler of the dask or ray cluster.")
    return backend(address(command))


@contextmanager
def cluster(backend: str, address: str | None) -> Iterator[None]:
    """Send joblib's tasks to a cluster while the context lasts."""
    import joblib

    if backend == "dask":
        with _dask_client(address), joblib.parallel_config(backend="dask"):
            yield
    elif backend == "ray":
        _start_ray(address)
        with joblib.parallel_config(backend="ray"):
            yield
    else:
        yield


def _dask_client(address: str | None) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError("dask.distributed", "cluster") from None
    return Client(address)


def _start_ray(address: str | None) -> None:
    try:
        import ray
        from ray.util.joblib import register_ray
    except ImportError:
        raise MissingExtraError("ray", "cluster") from None
    ray.init(address=address, ignore_reinit_error=True, log_to_driver=False)
    register_ray()

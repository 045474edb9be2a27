"""Connection to the cluster that a joblib backend needs, before joblib is asked for it."""

import os
from importlib import import_module
from typing import Any

from serd_core.errors import SerdError


def connect(backend: str) -> None:
    """Connect a `dask` or `ray` backend; other backends need nothing."""
    if backend == "dask":
        _connect_dask()
    elif backend == "ray":
        _imported("ray.util.joblib", "ray").register_ray()


def _connect_dask() -> None:
    """Keep the present client, or make one of the address in the environment."""
    distributed = _imported("distributed", "distributed")
    try:
        distributed.get_client()
    except ValueError:
        address = os.environ.get("DASK_SCHEDULER_ADDRESS")
        if not address:
            raise SerdError(
                "backend dask must be connected to a cluster, got none; set"
                " DASK_SCHEDULER_ADDRESS, for example to tcp://127.0.0.1:8786"
            ) from None
        try:
            distributed.Client(address)
        except (OSError, ValueError) as error:
            raise SerdError(
                f"DASK_SCHEDULER_ADDRESS must be that of a running scheduler, got {address}"
                f" ({error}); start one with `dask scheduler`"
            ) from error


def _imported(module: str, package: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise SerdError(
            f"backend {package} must be installed, but {error}; pip install {package}"
        ) from error

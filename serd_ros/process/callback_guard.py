"""Callbacks that no message can make end a node.

A message that breaks a rule (MessageError) is dropped, counted by topic and rule, and logged once
in 5 s. An unexpected exception is an internal error: it is logged with its traceback once in 5 s
and counted apart. Other errors of the project (a full disk) end the node with their sentence.
"""

import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

from rclpy.node import Node

from serd_files.errors import USER_ERRORS
from serd_ros.errors import MessageError

_LOG_PERIOD_S = 5.0
#: A timer that fails this often without success in between ends the node.
_FAILURES_IN_A_ROW = 10


class CallbackGuard:
    """Guards the callbacks of one node.

    n_internal_errors: since the start; after_each: called after each callback. An executor that
    receives messages faster than the node processes them does nothing between two callbacks.
    """

    def __init__(self, node: Node, fail: Callable[[str], None]) -> None:
        self.n_internal_errors = 0
        self.after_each: Callable[[], None] = lambda: None
        self._node, self._fail = node, fail
        self._rejected: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self._last_reason: dict[str, str] = {}
        self._logged_s: dict[str, float] = {}

    @property
    def n_rejected(self) -> int:
        """Messages dropped since the start."""
        return sum(counts.total() for counts in self._rejected.values())

    def values(self) -> dict[str, object]:
        """For `diagnostics`: `rejected.TOPIC` with counts by rule and the last reason."""
        values: dict[str, object] = {"internal_errors": self.n_internal_errors}
        for topic, counts in self._rejected.items():
            by_rule = ", ".join(f"{count} x {rule}" for rule, count in counts.items())
            values[f"rejected.{topic}"] = f"{by_rule}; last: {self._last_reason[topic]}"
        return values

    def of_messages(self, topic: str, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback of a subscription or future, with its signature, which rclpy looks at."""

        @wraps(callback)
        def guarded(*arguments: Any) -> None:
            if isinstance(arguments[0], tuple):  # EventsExecutor: message and info in one
                (arguments,) = arguments
            with self._handled(topic, callback):
                callback(*arguments)

        return guarded

    def of_requests(
        self, service: str, callback: Callable[[Any, Any], Any]
    ) -> Callable[[Any, Any], Any]:
        """The callback of a service; after an error it responds without success."""

        def guarded(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                if not isinstance(error, USER_ERRORS):
                    self.note(service, callback, error)
                refusal = type(response)()
                if hasattr(refusal, "success") and hasattr(refusal, "message"):
                    refusal.success, refusal.message = False, str(error)
                elif isinstance(error, USER_ERRORS) and self._is_due(service):
                    self._node.get_logger().warning(f"{service}: {error}")
                return refusal
            finally:
                self.after_each()

        return guarded

    def of_timer(self, callback: Callable[[], None]) -> Callable[[], None]:
        """The callback of a timer; it ends the node when it fails again and again."""
        name, n_failures = callback.__name__.strip("_"), 0

        def guarded() -> None:
            nonlocal n_failures
            n_before = self.n_internal_errors
            with self._handled(name, callback):
                callback()
            n_failures = n_failures + 1 if self.n_internal_errors > n_before else 0
            if n_failures == _FAILURES_IN_A_ROW:
                self._fail(f"{name} failed {n_failures} times in a row; report the traceback")

        return guarded

    @contextmanager
    def _handled(self, name: str, callback: object) -> Iterator[None]:
        """Within it no error ends an executor, which would print its traceback."""
        try:
            yield
        except MessageError as error:
            self._reject(name, error.rule, str(error))
        except USER_ERRORS as error:
            self._fail(str(error))
        except Exception as error:
            self.note(name, callback, error)
        finally:
            self.after_each()

    def _reject(self, topic: str, rule: str, reason: str) -> None:
        self._rejected[topic][rule] += 1
        self._last_reason[topic] = reason
        if self._is_due(topic):
            number = self._rejected[topic].total()
            self._node.get_logger().warning(f"{topic}: message {number} dropped: {reason}")

    def note(self, name: str, callback: object, error: Exception) -> None:
        """Count an unexpected exception; rclpy's own callbacks raise them for bad input."""
        if not self._node.context.ok():
            raise error
        if getattr(callback, "__module__", "").startswith("rclpy."):
            kind = type(error).__name__
            self._reject(name, f"rclpy raises {kind}", f"{kind}: {error}")
            return
        self.n_internal_errors += 1
        if self._is_due(f"internal error in {name}"):
            text = "".join(traceback.format_exception(error))
            self._node.get_logger().error(f"internal error in {name}:\n{text}")

    def _is_due(self, subject: str) -> bool:
        now_s = time.monotonic()
        if now_s - self._logged_s.get(subject, -_LOG_PERIOD_S) < _LOG_PERIOD_S:
            return False
        self._logged_s[subject] = now_s
        return True

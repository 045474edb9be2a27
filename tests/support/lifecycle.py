"""A lifecycle manager for tests: it drives the transitions of managed nodes by their services."""

import math
import time

from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import (
    ChangeState,
    GetAvailableStates,
    GetAvailableTransitions,
    GetState,
)
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

UP = (("configure", "inactive"), ("activate", "active"))
DOWN = (("deactivate", "inactive"), ("cleanup", "unconfigured"))
_SERVICES = {
    "change_state": ChangeState,
    "get_available_states": GetAvailableStates,
    "get_available_transitions": GetAvailableTransitions,
    "get_transition_graph": GetAvailableTransitions,
    "set_parameters": SetParameters,
    "get_state": GetState,
}
_ASK_AGAIN_S = 2.0


class LifecycleManager:
    """Of one node; probe: a node of the test's own that can spin. events: labels of states."""

    def __init__(self, probe, node):
        self._probe, self.events = probe, []
        probe.node.create_subscription(
            TransitionEvent,
            f"/{node}/transition_event",
            lambda event: self.events.append(event.goal_state.label),
            10,
        )
        create = probe.node.create_client
        self._clients = {name: create(kind, f"/{node}/{name}") for name, kind in _SERVICES.items()}
        self._become_known()

    def _become_known(self):
        """Ask for the state until there is an answer.

        A server's response is lost where it knows a client's request, but not its reader yet
        (ros2/rmw_fastrtps #842). The last client made here is the last to become known.
        """
        client, asked_s, answers = self._clients["get_state"], -math.inf, []

        def is_answered():
            nonlocal asked_s
            if time.monotonic() - asked_s > _ASK_AGAIN_S:
                asked_s = time.monotonic()
                answers.append(client.call_async(GetState.Request()))
            return any(each.done() for each in answers)

        self._probe.spin_until(client.service_is_ready, seen=lambda: client.srv_name)
        self._probe.spin_until(is_answered, seen=lambda: client.srv_name)

    def call(self, service, **fields):
        """The response of one of the node's services."""
        client = self._clients[service]
        self._probe.spin_until(client.service_is_ready, seen=lambda: client.srv_name)
        future = client.call_async(_SERVICES[service].Request(**fields))
        self._probe.spin_until(future.done, seen=lambda: client.srv_name)
        return future.result()

    def change(self, transition):
        """Whether the transition of this name succeeded."""
        wanted = Transition(label=transition)
        return self.call("change_state", transition=wanted).success

    def go(self, *transitions):
        """Make (transition, state after it) one after the other."""
        for transition, state in transitions:
            assert self.change(transition), transition
            assert self.state == state

    @property
    def state(self):
        """Label of the present state."""
        return self.call("get_state").current_state.label

    @property
    def states(self):
        """Labels of all states."""
        found = self.call("get_available_states").available_states
        return {each.label for each in found}

    def transitions(self, service="get_available_transitions"):
        """(label, state before, state after) of the possible ones, or of the whole graph."""
        found = self.call(service).available_transitions
        return {
            (each.transition.label, each.start_state.label, each.goal_state.label) for each in found
        }

    def set(self, name, value):
        """Why a parameter cannot be set; empty where it was."""
        parameters = [Parameter(name, value=value).to_parameter_msg()]
        (result,) = self.call("set_parameters", parameters=parameters).results
        return "" if result.successful else result.reason

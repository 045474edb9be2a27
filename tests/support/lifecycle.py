"""A lifecycle manager for tests: it drives the transitions of managed nodes by their services."""

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


class LifecycleManager:
    """Of one node; probe: a node of the test's own that can spin. events: labels of states."""

    def __init__(self, probe, node):
        self._probe, self._name, self._clients = probe, node, {}
        self.events = []
        probe.node.create_subscription(
            TransitionEvent,
            f"/{node}/transition_event",
            lambda event: self.events.append(event.goal_state.label),
            10,
        )

    def call(self, kind, service, **fields):
        """The response of one of the node's services."""
        name = f"/{self._name}/{service}"
        if name not in self._clients:
            self._clients[name] = self._probe.node.create_client(kind, name)
        client = self._clients[name]
        self._probe.spin_until(client.service_is_ready, seen=lambda: name)
        future = client.call_async(kind.Request(**fields))
        self._probe.spin_until(future.done, seen=lambda: name)
        return future.result()

    def change(self, transition):
        """Whether the transition of this name succeeded."""
        wanted = Transition(label=transition)
        return self.call(ChangeState, "change_state", transition=wanted).success

    def go(self, *transitions):
        """Make (transition, state after it) one after the other."""
        for transition, state in transitions:
            assert self.change(transition), transition
            assert self.state == state

    @property
    def state(self):
        """Label of the present state."""
        return self.call(GetState, "get_state").current_state.label

    @property
    def states(self):
        """Labels of all states."""
        found = self.call(GetAvailableStates, "get_available_states").available_states
        return {each.label for each in found}

    def transitions(self, service="get_available_transitions"):
        """(label, state before, state after) of the possible ones, or of the whole graph."""
        found = self.call(GetAvailableTransitions, service).available_transitions
        return {
            (each.transition.label, each.start_state.label, each.goal_state.label) for each in found
        }

    def set(self, name, value):
        """Why a parameter cannot be set; empty where it was."""
        parameters = [Parameter(name, value=value).to_parameter_msg()]
        (result,) = self.call(SetParameters, "set_parameters", parameters=parameters).results
        return "" if result.successful else result.reason

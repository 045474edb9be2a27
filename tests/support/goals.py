"""Goals for a strategy that drives a robot."""

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped

from serd_app.drives.drive import END
from serd_ros.convert.diagnostics import from_episode_message
from serd_ros.convert.motion import to_pose_stamped
from serd_ros.endpoints import qos


class Goals:
    """Sends goals one after the other and takes how their drives end."""

    def __init__(self, probe):
        self.probe, self.n_begun, self.ends = probe, 0, []
        self._goals = probe.node.create_publisher(PoseStamped, "goal_pose", qos.COMMAND)
        probe.node.create_subscription(DiagnosticArray, "episode", self._take_mark, qos.STATE)

    def _take_mark(self, message):
        mark = from_episode_message(message)
        if mark.event == END:
            self.ends.append(mark.outcome)
        else:
            self.n_begun += 1

    def send(self, place):
        self.probe.spin_until(lambda: self._goals.get_subscription_count() > 0)
        self._goals.publish(to_pose_stamped((*place, 0.0), 0.0))

    def drive_to(self, place, seen):
        n_ended = len(self.ends)
        self.send(place)
        self.probe.spin_until(lambda: len(self.ends) > n_ended, seen=seen)

from lab.benchmarks.speed_figure import Comparison, Peer, speed_figure


def test_a_peer_that_is_faster_is_drawn_to_the_left_and_said_so():
    peers = (Peer("slow", 20.0), Peer("fast", 0.5))
    axes = speed_figure([Comparison("work", "3 ms", peers)]).axes[0]
    slow, fast = axes.patches
    assert (slow.get_x(), slow.get_width()) == (1, 19)
    assert (fast.get_x(), fast.get_width()) == (1, -0.5)
    assert {"20×", "0.5×"} <= {text.get_text() for text in axes.texts}

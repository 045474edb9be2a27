from benchmarks.speed_figure import Comparison, Peer, comparisons, speed_figure


def test_every_kept_comparison_has_peers_with_a_time():
    compared = list(comparisons())
    assert len(compared) == 7
    assert all(peer.times_ours > 0 for each in compared for peer in each.peers)
    names = {peer.name for each in compared for peer in each.peers}
    assert {"econirl NFXP", "imitation MCE-IRL", "IR-SIM 2.12.0", "rosbags"} <= names
    assert len({peer.name for each in compared for peer in each.peers}) == len(
        [peer for each in compared for peer in each.peers]
    )


def test_a_peer_that_is_faster_is_drawn_to_the_left_and_said_so():
    peers = (Peer("slow", 20.0), Peer("fast", 0.5))
    axes = speed_figure([Comparison("work", "3 ms", peers)]).axes[0]
    slow, fast = axes.patches
    assert (slow.get_x(), slow.get_width()) == (1, 19)
    assert (fast.get_x(), fast.get_width()) == (1, -0.5)
    assert {"20×", "0.5×"} <= {text.get_text() for text in axes.texts}

"""watch_page: the layers of the newest model of a learner on its page."""

from std_msgs.msg import String

from support.nodes_in_process import node_in_process
from support.waiting import wait_until


def test_the_page_has_the_layers_of_the_newest_model_and_a_bad_one_changes_nothing(
    save_model_of, monkeypatch
):
    text, shown = save_model_of().read_text(), []
    with node_in_process("watch_page", port=0) as running:
        monkeypatch.setattr(running.node._server, "show_overlay", shown.append)
        running.receive("model", String(data=text))
        wait_until(lambda: shown, turn=running.call_timers)
        (layers,) = shown
        assert len(layers["arrival"]["labels"]) == len(layers["policy"]["directions"])
        for bad in (text.replace("discount: 0.99", "discount: 7"), "scenario: hallway", "]"):
            running.receive("model", String(data=bad))
            wait_until(lambda: running.node._overlay._newest is None, turn=running.call_timers)
            wait_until(lambda: running.node._overlay._solved is None, turn=running.call_timers)
        assert len(shown) == 1
        running.assert_alive()

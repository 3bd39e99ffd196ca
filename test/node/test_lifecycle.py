# Copyright 2026 lmsco_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""Lifecycle transitions work, free what they took, and can be repeated."""

from geometry_msgs.msg import PolygonStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.lifecycle import TransitionCallbackReturn
from sensor_msgs.msg import Image, RegionOfInterest
from std_srvs.srv import SetBool, Trigger


def entities(node):
    """Return the topics and services that the node offers or listens to."""
    return (sorted(p.topic_name for p in node.publishers),
            sorted(s.topic_name for s in node.subscriptions),
            sorted(s.srv_name for s in node.services), len(list(node.timers)))


def change(graph, transition):
    """Ask for a transition as `ros2 lifecycle set` does."""
    request = Transition(id=transition)
    return graph.call(ChangeState, 'lmsco_tracker/change_state', transition=request).success


def state(graph):
    return graph.call(GetState, 'lmsco_tracker/get_state').current_state.id


def test_without_autostart_nothing_happens_until_it_is_asked_for(graph):
    node = graph.start_tracker(autostart=False)
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert not node.is_active
    unconfigured = entities(node)
    assert change(graph, Transition.TRANSITION_CONFIGURE)
    assert state(graph) == State.PRIMARY_STATE_INACTIVE
    assert entities(node) != unconfigured and not node.is_active
    assert change(graph, Transition.TRANSITION_ACTIVATE)
    assert state(graph) == State.PRIMARY_STATE_ACTIVE
    assert node.is_active


def test_whole_circle_frees_everything_and_tracks_again(graph):
    node = graph.start_tracker(autostart=False)
    unconfigured = entities(node)
    for _ in range(2):
        change(graph, Transition.TRANSITION_CONFIGURE)
        inactive = entities(node)
        change(graph, Transition.TRANSITION_ACTIVATE)
        boxes = graph.listen(PolygonStamped, 'lmsco_tracker/box')
        graph.publisher(RegionOfInterest, 'init_box').publish(
            RegionOfInterest(x_offset=1, y_offset=2, width=3, height=4))
        images = graph.publisher(Image, 'image_raw')
        count = len(boxes)
        images.publish(graph.image())
        graph.spin_until(lambda: len(boxes) > count)
        worker = node._session.worker
        assert change(graph, Transition.TRANSITION_DEACTIVATE)
        assert entities(node) == inactive and not worker._thread.is_alive()
        assert change(graph, Transition.TRANSITION_CLEANUP)
        assert entities(node) == unconfigured


def test_deactivating_drops_the_target(running):
    running.start()
    assert running.send().state == 'tracking'
    running.node.trigger_deactivate()
    running.node.trigger_activate()
    running.graph.spin_until(lambda: running.images.get_subscription_count() == 1)
    assert running.send().state == 'idle'


def test_services_say_that_the_node_is_not_active(running):
    running.node.trigger_deactivate()
    for kind, name in ((Trigger, 'reset'), (SetBool, 'set_enabled')):
        answer = running.graph.call(kind, f'lmsco_tracker/{name}')
        assert not answer.success and 'activate' in answer.message


def test_shutdown_from_every_state(graph):
    node = graph.start_tracker(autostart=False)
    empty = entities(node)
    node.trigger_configure()
    node.trigger_activate()
    worker = node._session.worker
    assert change(graph, Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert state(graph) == State.PRIMARY_STATE_FINALIZED
    assert entities(node) == empty and not worker._thread.is_alive()


def test_tracker_that_cannot_be_made_is_reported_and_can_be_mended(graph):
    broken = True

    def factory(settings):
        if broken:
            raise OSError('no weights')
        return graph.fake
    node = graph.start_tracker(tracker_factory=factory)
    assert not node.is_active
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    broken = False
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS


def test_error_while_activating_frees_everything(graph, monkeypatch):
    node = graph.start_tracker(autostart=False)
    unconfigured = entities(node)
    node.trigger_configure()
    monkeypatch.delattr('lmsco_ros.node.session.Inputs')
    assert node.trigger_activate() == TransitionCallbackReturn.ERROR
    assert state(graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert entities(node) == unconfigured and not node.is_active
    monkeypatch.undo()
    node.trigger_configure()
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS


def test_stuck_tracker_does_not_block_deactivation(running):
    running.start()
    running.send()
    running.fake.gate.clear()
    running.images.publish(running.graph.image())
    running.graph.spin_until(lambda: len(running.fake.calls) == 2)
    assert running.node.trigger_deactivate() == TransitionCallbackReturn.ERROR
    assert state(running.graph) == State.PRIMARY_STATE_UNCONFIGURED
    assert not running.node.is_active

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

"""
The page in a real browser, with a rendered camera and the real tracker.

Needs Chromium, its driver and selenium, and is skipped with the reason where one is missing.
"""

import contextlib
import json
from operator import itemgetter
import os
from pathlib import Path
import queue
import re
import shutil
import subprocess
import sys
import threading
import time

import cv2
import numpy as np
import pytest

pytest.importorskip('selenium', reason="selenium is missing; pip install '.[browser-test]'")
for program in ('chromium', 'chromedriver'):
    if shutil.which(program) is None:
        pytest.skip(f'{program} is missing; apt-get install chromium chromium-driver',
                    allow_module_level=True)

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402, I100
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import qos_profile_sensor_data  # noqa: E402
from selenium import webdriver  # noqa: E402
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402
from selenium.webdriver.support.ui import WebDriverWait  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402

from lmsco_ros.console.annotate import annotating  # noqa: E402
from lmsco_ros.console.console_node import ConsoleNode  # noqa: E402
from lmsco_ros.console.server import serving  # noqa: E402
from lmsco_ros.console.settings import ConsoleSettings  # noqa: E402
from lmsco_ros.node.tracker_node import TrackerNode  # noqa: E402
from lmsco_ros.synthetic import render_scene, SceneConfig  # noqa: E402
from msg_adapters.image import message_from_image  # noqa: E402

REPOSITORY = Path(__file__).resolve().parents[2]
PATIENCE = 100.0
PLOT = SceneConfig(width=320, height=256, frames=150, clutter=15)
# Until here the target walks alone; then others cross its way.
ALONE = 45


@pytest.fixture(scope='module')
def frames():
    """Return the rendered scene."""
    return list(render_scene(PLOT))


def without_anybody(frame):
    """Return a frame in which nothing has an outline any more."""
    blurred = cv2.GaussianBlur(frame.image.astype(np.float32), (0, 0), 25)
    return (blurred + np.random.default_rng(0).normal(0, PLOT.noise, blurred.shape)
            ).astype(np.uint16)


def nanoseconds(stamp):
    """Return the time of a message."""
    return stamp.sec * 10 ** 9 + stamp.nanosec


class Site:
    """
    A camera that goes to and fro in the scene at 30 Hz, tracker, console and server.

    The scene moves on once the tracker has answered: no faster than a busy machine can follow.
    """

    def __init__(self, frames):
        self._frames = [(message_from_image(frame.image), message_from_image(
            without_anybody(frame)), frame.box) for frame in frames[:ALONE]]
        self.truth, self.hidden, self._place = {}, False, 0
        self._shown = self._answered = 0
        self.context = Context()
        self.context.init()
        self.executor = SingleThreadedExecutor(context=self.context)
        self.camera = Node('camera', context=self.context)
        self.images = self.camera.create_publisher(Image, 'image_raw', qos_profile_sensor_data)
        self.camera.create_timer(1 / 30, self._expose)
        self.camera.create_subscription(
            DiagnosticArray, 'lmsco_tracker/status', self._take_answer, 10)
        self.console = ConsoleNode(context=self.context)
        self.executor.add_node(self.camera)
        self.executor.add_node(self.console)
        self.start_tracker()
        self._orders, self._ended = queue.Queue(), threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def start_tracker(self):
        """Start the real tracker."""
        self.tracker = TrackerNode(context=self.context, parameter_overrides=[
            Parameter('max_targets', value=3), Parameter('radiometric_scale', value=0.04),
            Parameter('radiometric_offset', value=-273.15)])
        self.executor.add_node(self.tracker)

    def kill_tracker(self):
        """Take the tracker away."""
        self.executor.remove_node(self.tracker)
        self.tracker.destroy_node()
        self.tracker = None

    def order(self, work):
        """Have something done between two messages, and wait until it is."""
        done = threading.Event()
        self._orders.put(lambda: (work(), done.set()))
        assert done.wait(PATIENCE)

    def box(self, stamp):
        """Return where the target was in the frame with a stamp."""
        return self.truth[stamp]

    def close(self):
        """Take everything down."""
        self._ended.set()
        self._thread.join()
        for node in (self.camera, self.console, self.tracker):
            if node is not None:
                node.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()

    def _expose(self):
        """Publish the next frame, with or without the target."""
        if self._answered >= self._shown:
            self._place = (self._place + 1) % (2 * ALONE)
        seen, empty, box = self._frames[min(self._place, 2 * ALONE - 1 - self._place)]
        message = empty if self.hidden else seen
        message.header.stamp = self.camera.get_clock().now().to_msg()
        self._shown = nanoseconds(message.header.stamp)
        self.truth[str(self._shown)] = box.as_tuple()
        self.images.publish(message)

    def _take_answer(self, message):
        self._answered = max(self._answered, nanoseconds(message.header.stamp))

    def _spin(self):
        while not self._ended.is_set():
            with contextlib.suppress(queue.Empty):
                self._orders.get_nowait()()
            self.executor.spin_once(timeout_sec=0.05)


@pytest.fixture(scope='module')
def site(frames):
    site = Site(frames)
    yield site
    site.close()


@pytest.fixture
def address(site):
    """Offer the page, and return where."""
    with serving(site.console.desk, ConsoleSettings(port=0)) as address:
        yield address


def open_browser(size=(1280, 800)):
    """Return a browser with a window of a size."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which('chromium')
    for argument in ('--headless=new', '--no-sandbox', '--disable-gpu', '--no-proxy-server',
                     '--disable-background-networking', '--force-prefers-reduced-motion',
                     '--window-size={},{}'.format(*size)):
        options.add_argument(argument)
    options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
    return webdriver.Chrome(options, webdriver.ChromeService(shutil.which('chromedriver')))


@pytest.fixture(scope='module')
def browser():
    """Return a browser with the window of a desktop."""
    with open_browser() as browser:
        yield browser


class Page:
    """The page as a person sees and uses it."""

    def __init__(self, browser, address):
        self.browser = browser
        browser.get(address)
        self.until(lambda: self.canvas.get_attribute('data-number'))

    @property
    def canvas(self):
        return self.browser.find_element(By.ID, 'stage')

    @property
    def state(self):
        """What is drawn."""
        return json.loads(self.canvas.get_attribute('data-state'))

    def text(self, name):
        return self.browser.find_element(By.ID, name).text

    def until(self, condition):
        return WebDriverWait(self.browser, PATIENCE, 0.05).until(lambda browser: condition())

    def key(self, key):
        # Without a click, which would start on what is there.
        self.browser.execute_script('arguments[0].focus();', self.canvas)
        ActionChains(self.browser).send_keys(key).perform()

    def drag(self, box):
        """Drag a box given in pixels of the image."""
        place = json.loads(self.canvas.get_attribute('data-place'))
        size = self.canvas.size
        x, y, width, height = (place['scale'] * value for value in box)
        left = place['left'] + x - size['width'] / 2
        top = place['top'] + y - size['height'] / 2
        chain = ActionChains(self.browser, duration=20)
        chain.move_to_element_with_offset(self.canvas, round(left), round(top))
        chain.click_and_hold().move_by_offset(round(width), round(height)).release().perform()

    def click(self, box):
        """Click on the middle of a box given in pixels of the image."""
        place = json.loads(self.canvas.get_attribute('data-place'))
        at = [place[start] + place['scale'] * (box[axis] + box[axis + 2] / 2)
              for axis, start in enumerate(('left', 'top'))]
        ActionChains(self.browser, duration=20).move_to_element_with_offset(
            self.canvas, *(round(value - self.canvas.size[side] / 2)
                           for value, side in zip(at, ('width', 'height')))).click().perform()

    def start(self, site):
        """Pause, drag a box around the target in the frame that is shown, and go on."""
        self.pause()
        self.drag(site.box(self.state['stamp']))
        self.key(' ')
        self.until(lambda: self.state['state'] == 'tracking')

    def pause(self):
        """Have the view stand still."""
        self.key(' ')
        self.until(lambda: self.browser.find_element(By.ID, 'frozen').is_displayed())

    def complaints(self):
        """Return what the browser complained of."""
        return [entry for entry in self.browser.get_log('browser')
                if entry['level'] == 'SEVERE' and 'WebSocket' not in entry['message']]


@pytest.fixture
def page(site, browser, address):
    """Return the page, without a target."""
    site.hidden = False
    page = Page(browser, address)
    page.key(Keys.ESCAPE)
    page.until(lambda: page.state['state'] == 'idle')
    yield page
    assert not page.complaints()


def overlap(one, other):
    """Return the intersection over the union of two boxes (x, y, width, height)."""
    sides = [min(one[axis] + one[axis + 2], other[axis] + other[axis + 2])
             - max(one[axis], other[axis]) for axis in (0, 1)]
    shared = max(sides[0], 0) * max(sides[1], 0)
    return shared / (one[2] * one[3] + other[2] * other[3] - shared)


def test_drag_starts_a_track_that_stays_on_the_target(page, site):
    page.start(site)
    overlaps = {}
    deadline = time.monotonic() + PATIENCE
    while len(overlaps) < 60:
        assert time.monotonic() < deadline
        state = page.state
        assert state['state'] in ('tracking', 'uncertain')
        overlaps[int(state['stamp'])] = overlap(state['targets'][0]['box'],
                                                site.box(state['stamp']))
    assert np.mean(list(overlaps.values())) > 0.5
    assert min(overlaps.values()) > 0.2
    # What is seen for a moment may be uncertain.
    page.until(lambda: 'tracking' in page.text('state') and '°C' in page.text('heat'))
    page.until(lambda: ' tracking' in page.canvas.get_attribute('aria-label'))


def test_click_starts_on_what_is_there_and_is_answered(page, site):
    page.pause()
    truth = site.box(page.state['stamp'])
    page.click(truth)
    # The view stands still; the answer comes all the same.
    page.until(lambda: 'is followed' in page.text('answer'))
    page.key(' ')
    page.until(lambda: page.state['state'] == 'tracking')
    state = page.state
    box = state['targets'][0]['box']
    x, y, width, height = site.box(state['stamp'])
    assert box[0] < x + width / 2 < box[0] + box[2] and box[1] < y + height / 2 < box[1] + box[3]


def test_start_that_is_refused_is_told_with_its_reason(page, site):
    page.pause()
    seen = page.state['stamp']
    # The tracker keeps frames for two seconds, and no more than 64.
    page.until(lambda: int(max(site.truth, key=int)) - int(seen) > 5e9)
    page.drag(site.box(seen))
    page.until(lambda: 'too old' in page.text('answer'))
    assert 'refused' in page.browser.find_element(By.ID, 'answer').get_attribute('class')
    page.key(' ')
    page.until(lambda: page.state['state'] == 'idle')
    page.until(lambda: 'start refused' in page.text('history'))


def test_start_that_nobody_answers_is_told(page, site):
    site.order(site.kill_tracker)
    page.until(lambda: 'tracker says nothing' in page.text('banner'))
    page.click((5, 5, 20, 20))
    page.until(lambda: 'asked the tracker' in page.text('answer'))
    page.until(lambda: 'has not answered' in page.text('answer'))
    site.order(site.start_tracker)
    page.until(lambda: page.state['state'] == 'idle')


def test_what_happened_before_is_history_and_no_news(page, site, address):
    page.start(site)
    page.until(lambda: 'started' in page.text('history'))
    with open_browser() as browser:
        other = Page(browser, address)
        other.until(lambda: 'started' in other.text('history'))
        assert other.text('answer') == ''


def test_box_is_drawn_where_the_state_says(page, site):
    page.start(site)
    page.pause()
    colored = page.browser.execute_script("""
        const canvas = document.getElementById('stage');
        const state = JSON.parse(canvas.dataset.state), place = JSON.parse(canvas.dataset.place);
        const [x, y, width, height] = state.targets[0].box.map(value => value * place.scale);
        const pen = canvas.getContext('2d'), ratio = window.devicePixelRatio;
        const at = (left, top) => pen.getImageData(
            Math.round(ratio * left), Math.round(ratio * top), 1, 1).data.slice(0, 3);
        const rows = [];
        for (let part = .1; part < 1; part += .2) {
            rows.push([...at(place.left + x, place.top + y + part * height)]);
            rows.push([...at(place.left + x + width, place.top + y + part * height)]);
        }
        return rows;""")
    page.key(' ')
    # The line is turquoise on an image of grays.
    assert all(green - red > 60 for red, green, blue in colored)


def test_lost_and_found_are_shown(page, site):
    page.start(site)
    site.hidden = True
    page.until(lambda: page.state['state'] == 'lost')
    page.until(lambda: 'lost' in page.text('banner'))
    # Where it is expected comes in a message of its own, for which a frame waits but a moment.
    target = page.until(lambda: next(filter(itemgetter('expected'), page.state['targets']), None))
    assert target['box'] is None and target['expected']['axes'][0] > 0
    page.until(lambda: page.text('position').startswith('about ') and 'px/s' in page.text('speed'))
    site.hidden = False
    page.until(lambda: page.state['state'] == 'tracking')
    page.until(lambda: not page.text('banner'))
    page.until(lambda: 'found again' in page.text('history'))
    assert 'lost' in page.text('history') and 'started' in page.text('history')
    images = page.browser.find_elements(By.CSS_SELECTOR, '#history img')
    assert images and all(image.get_property('naturalWidth') for image in images)


def test_buttons_reset_and_stop(page, site):
    page.start(site)
    page.browser.find_element(By.ID, 'reset').click()
    page.until(lambda: page.state['state'] == 'idle')
    page.until(lambda: 'dropped' in page.text('answer'))
    page.browser.find_element(By.ID, 'enable').click()
    page.until(lambda: page.state['state'] == 'disabled')
    page.until(lambda: page.text('enable') == 'Resume tracker')
    page.browser.find_element(By.ID, 'enable').click()
    page.until(lambda: page.state['state'] == 'idle')


def test_arrows_step_while_paused(page):
    page.pause()
    number = page.state['number']
    page.key(Keys.ARROW_LEFT)
    page.until(lambda: page.state['number'] < number)
    earlier = page.state['number']
    page.key(Keys.ARROW_RIGHT)
    page.until(lambda: page.state['number'] > earlier)
    page.key(' ')
    page.until(lambda: page.state['number'] > number)


def test_start_by_numbers_needs_no_pointer(page, site):
    page.pause()
    box = site.box(page.state['stamp'])
    page.browser.find_element(By.TAG_NAME, 'summary').send_keys(Keys.ENTER)
    for name, value in zip(('x', 'y', 'width', 'height'), box):
        page.browser.find_element(By.NAME, name).send_keys(f'{value:.1f}')
    page.browser.find_element(By.NAME, 'height').send_keys(Keys.ENTER)
    page.key(' ')
    page.until(lambda: page.state['state'] == 'tracking')


def test_click_on_a_box_selects_it(page, site):
    page.start(site)
    first = page.state['selected']
    page.drag((20, 200, 30, 30))
    page.until(lambda: page.state['selected'] not in (0, first))
    page.until(lambda: len(page.browser.find_elements(By.CSS_SELECTOR, '#targets button')) == 2)
    page.browser.find_element(By.CSS_SELECTOR, f'#targets [data-id="{first}"]').click()
    page.until(lambda: page.state['selected'] == first)


def test_palette_and_layer_can_be_chosen(page, site):
    page.start(site)
    page.browser.find_element(By.CSS_SELECTOR, '#palette [value="inferno"]').click()
    page.browser.find_element(By.ID, 'confidence').click()
    page.until(lambda: page.browser.execute_script("""
        const canvas = document.getElementById('stage');
        const data = canvas.getContext('2d').getImageData(
            canvas.width / 4, canvas.height / 2, canvas.width / 2, canvas.height / 3).data;
        let warm = 0;
        for (let at = 0; at < data.length; at += 4) warm += data[at] > data[at + 1] + 30;
        return warm > data.length / 40;"""))
    page.browser.find_element(By.ID, 'confidence').click()


def test_two_pages_see_the_same_and_a_stuck_one_harms_nobody(page, site, address):
    page.start(site)
    with open_browser((390, 844)) as phone:
        other = Page(phone, address)
        other.until(lambda: other.state['state'] == 'tracking')
        # As if the page were busy for good: it asks for nothing any more.
        phone.execute_script('WebSocket.prototype.send = () => {};')
        number = page.state['number']
        page.until(lambda: page.state['number'] > number + 30)
        page.until(lambda: page.state['state'] == 'tracking')
        assert not other.complaints()


def test_tracker_that_is_killed_and_started_again(page, site):
    site.order(site.kill_tracker)
    page.until(lambda: 'tracker says nothing' in page.text('banner'))
    number = page.state['number']
    page.until(lambda: page.state['number'] > number)
    site.order(site.start_tracker)
    page.until(lambda: page.state['state'] == 'idle')
    page.until(lambda: not page.text('banner'))
    page.start(site)


def test_page_comes_back_when_the_server_does(site, browser):
    with serving(site.console.desk, ConsoleSettings(port=0)) as address:
        page = Page(browser, address)
    page.until(lambda: page.text('link') == 'not connected')
    port = int(address.rstrip('/').rpartition(':')[2])
    with serving(site.console.desk, ConsoleSettings(port=port)):
        page.until(lambda: page.text('link') == 'connected')
        number = page.state['number']
        page.until(lambda: page.state['number'] > number)
        browser.get('about:blank')


@pytest.fixture
def run(tmp_path):
    """Return what runs a program of the package, and tells what that wrote."""
    started = []

    def begin(module, *arguments):
        log = tmp_path / f'{len(started)}.log'
        with log.open('w') as file:
            process = subprocess.Popen(
                [sys.executable, '-m', module, '--ros-args', *arguments], cwd=REPOSITORY,
                stdout=file, stderr=subprocess.STDOUT)
        started.append(process)
        return process, log.read_text
    yield begin
    for process in started:
        process.kill()
        process.wait()


def test_page_comes_back_after_the_console_was_killed(site, browser, run, until):
    def offered(port):
        process, told = run('lmsco_ros.console.main', '-p', f'port:={port}')

        def address():
            assert process.poll() is None, told()
            return re.search(r'the page is at (.*:(\d+)/)', told())
        return process, until(address)

    process, address = offered(0)
    page = Page(browser, address[1])
    process.kill()
    page.until(lambda: page.text('link') == 'not connected')
    assert 'does not answer' in page.text('banner')
    number = page.state['stamp']
    offered(address[2])
    page.until(lambda: page.text('link') == 'connected')
    page.until(lambda: int(page.state['stamp']) > int(number) and not page.text('banner'))
    page.start(site)
    browser.get('about:blank')


def test_page_shows_a_tracker_that_was_killed_by_force_and_started_again(page, site, run):
    site.order(site.kill_tracker)
    page.until(lambda: 'tracker says nothing' in page.text('banner'))
    process, _ = run('lmsco_ros.node.main')
    page.until(lambda: not page.text('banner'))
    page.start(site)
    process.kill()
    page.until(lambda: 'tracker says nothing' in page.text('banner'))
    process, _ = run('lmsco_ros.node.main')
    page.until(lambda: page.state['state'] == 'idle')
    page.until(lambda: not page.text('banner'))
    page.start(site)
    process.kill()
    page.until(lambda: 'tracker says nothing' in page.text('banner'))
    site.order(site.start_tracker)
    page.until(lambda: page.state['state'] == 'idle')


@pytest.mark.parametrize('size', [(1280, 800), (390, 844), (844, 390)])
def test_nothing_is_wider_than_the_window(site, address, size):
    with open_browser(size) as browser:
        page = Page(browser, address)
        wide = browser.execute_script(
            'return document.documentElement.scrollWidth - window.innerWidth')
        assert wide <= 0
        assert not page.complaints()


@pytest.mark.skipif('LMSCO_AXE' not in os.environ,
                    reason='set LMSCO_AXE to the file axe.min.js of the npm package axe-core')
@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_accessibility_checker_finds_nothing(page, site, scheme):
    page.start(site)
    page.drag((20, 200, 30, 30))
    page.until(lambda: len(page.state['targets']) == 2)
    page.browser.execute_cdp_cmd('Emulation.setEmulatedMedia', {
        'features': [{'name': 'prefers-color-scheme', 'value': scheme}]})
    page.browser.execute_script(Path(os.environ['LMSCO_AXE']).read_text())
    for hidden, state in ((False, 'tracking'), (True, 'lost')):
        site.hidden = hidden
        # The other target may be lost at any time: there is nothing to see of it.
        page.until(lambda: state in {each['state'] for each in page.state['targets']})
        found = page.browser.execute_async_script(
            'axe.run().then(arguments[0]);')
        assert not [(each['id'], each['nodes'][0]['target']) for each in found['violations']]


def test_target_is_marked_in_a_recording(frames, browser, tmp_path):
    (tmp_path / 'frames').mkdir()
    for frame in frames[:9]:
        cv2.imwrite(str(tmp_path / 'frames' / f'{frame.index}.png'), frame.image)
    output = tmp_path / 'marks.txt'
    with annotating(tmp_path / 'frames', output, ConsoleSettings(port=0)) as (address, *_):
        page = Page(browser, address)
        assert page.state['state'] == 'unmarked' and page.text('frame-number') == '1 of 9'
        page.drag(frames[0].box.as_tuple())
        page.until(lambda: page.state['state'] == 'marked')
        for number in range(2, 10):
            page.key(Keys.ARROW_RIGHT)
            page.until(lambda: page.state['number'] == number)
        page.drag(frames[8].box.as_tuple())
        page.until(lambda: page.state['state'] == 'marked')
        page.key(Keys.ARROW_LEFT)
        page.until(lambda: page.state['state'] == 'interpolated')
        # It plays to its end, and stands still there.
        page.browser.execute_script("document.getElementById('place').value = 1;"
                                    "document.getElementById('place').dispatchEvent("
                                    "new Event('input'));")
        page.until(lambda: page.state['number'] == 1)
        page.key(' ')
        page.until(lambda: page.state['number'] == 9)
        page.until(lambda: page.text('pause-word') == 'Play')
        assert not page.complaints()
        browser.get('about:blank')
    marked = np.loadtxt(output, delimiter=',')
    truth = [frame.box.as_tuple() for frame in frames[:9]]
    assert min(overlap(*pair) for pair in zip(marked, truth)) > 0.6

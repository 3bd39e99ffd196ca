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

"""Names of the challenges, and what each of them shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from lmsco_ros.evaluation.challenges.burnt_in_text import text
from lmsco_ros.evaluation.challenges.camouflage import camouflage
from lmsco_ros.evaluation.challenges.leaving import leave, leave_edge
from lmsco_ros.evaluation.challenges.other_view import cut_other_view
from lmsco_ros.evaluation.challenges.presence import cut, disappear, twin, twin_crosses
from lmsco_ros.evaluation.challenges.sensor import (
    dead_pixels, gain_jump, no_value, polarity, shutter, sixteen_bit, telemetry)
from lmsco_ros.evaluation.challenges.starts import start_on_background, start_on_noise
from lmsco_ros.evaluation.challenges.steps import contrast_step, noise_step, stretch_step
from lmsco_ros.evaluation.datasets import TrackingSequence
from lmsco_ros.evaluation.errors import RequestError


@dataclass(frozen=True)
class Challenge:
    """
    A way to make a sequence harder.

    Attributes
    ----------
    description : str
        What happens, in half a sentence.
    apply : callable
        Returns the changed sequence, or raises `SequenceError` where it does not fit.

    """

    description: str
    apply: Callable[[TrackingSequence], TrackingSequence]


CHALLENGES: Mapping[str, Challenge] = {
    'disappear_1s': Challenge('the target is replaced by background for 30 frames',
                              partial(disappear, seconds=1)),
    'disappear_3s': Challenge('the target is replaced by background for 90 frames',
                              partial(disappear, seconds=3)),
    'leave': Challenge('the picture pans away from the target and back', leave),
    'leave_edge': Challenge('the target leaves slowly over the edge, stays there, and is back',
                            leave_edge),
    'cut': Challenge('frames are missing, so that the target jumps', cut),
    'cut_other_view': Challenge('after a cut another view is shown, in which the target comes '
                                'up two seconds later', cut_other_view),
    'twin': Challenge('a copy of the target moves beside it', twin),
    'twin_crosses': Challenge('a copy of the target crosses it on another course',
                              twin_crosses),
    'twin_remains': Challenge('beside a copy of itself, the target disappears for 30 frames',
                              lambda sequence: disappear(twin(sequence), 1)),
    'camouflage': Challenge('from a third on, the target has a quarter of its contrast',
                            camouflage),
    'shutter': Challenge('the picture stands for 12 frames every 60', shutter),
    'gain_jump': Challenge('gain and offset jump every 20 frames', gain_jump),
    'noise_step': Challenge('from a third on, the noise is six times as strong', noise_step),
    'contrast_step': Challenge('for a third of the time, the contrast is 0.3 of what it was',
                               contrast_step),
    'stretch_step': Challenge('from a third on, contrast 0.3 and six times the noise at once',
                              stretch_step),
    'polarity': Challenge('white hot and black hot change places for a third of the time',
                          polarity),
    'dead_pixels': Challenge('dead pixels, rows and columns', dead_pixels),
    'telemetry': Challenge('four rows of noise at the top', telemetry),
    'nan': Challenge('float images with spots of NaN and infinity', no_value),
    'text': Challenge('a clock, a reticle and a blinking word are drawn into the picture', text),
    'sixteen_bit': Challenge('510 of 65,536 counts, with drift', sixteen_bit),
    'start_on_background': Challenge('the tracker is started where nothing stands out',
                                     start_on_background),
    'start_on_noise': Challenge('the tracker is started on noise that is new in each frame',
                                start_on_noise),
}


def challenge_names(names: list[str]) -> tuple[str, ...]:
    """
    Return the challenges that a list of names asks for, each once; `all` is every one.

    Raises
    ------
    RequestError
        When one is unknown.

    """
    chosen: dict[str, None] = {}
    for name in names:
        if name != 'all' and name not in CHALLENGES:
            raise RequestError(f'there is no challenge {name!r}; known are '
                               f'{", ".join(CHALLENGES)} and all')
        chosen.update(dict.fromkeys(CHALLENGES if name == 'all' else [name]))
    return tuple(chosen)


def apply_challenge(sequence: TrackingSequence, name: str) -> TrackingSequence:
    """
    Return a sequence with a challenge, which its name then tells.

    Parameters
    ----------
    sequence : TrackingSequence
        Images and true boxes stay where they are and are changed when asked for.
    name : str
        One of `CHALLENGES`.

    Raises
    ------
    SequenceError
        When the sequence is too short or otherwise unfit for the challenge.

    """
    changed = CHALLENGES[name].apply(sequence)
    return replace(changed, name=f'{sequence.name}+{name}', challenge=name)

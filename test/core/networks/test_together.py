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

"""Works whose asks are answered together."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
import torch

from lmsco_ros.core.networks.extent import ExtentNet
from lmsco_ros.core.networks.together import Ask, at_once, in_step, side_by_side


class Doubler:
    """Answers numbers by twice as much, and keeps what was asked together."""

    def __init__(self):
        self.asked = []

    def __call__(self, subjects):
        self.asked.append(list(subjects))
        return [2 * subject for subject in subjects]


def work(doubler, numbers, whom='doubler'):
    """Ask about numbers, one after the other; return the answers."""
    told = []
    for number in numbers:
        told.append((yield Ask(whom, doubler, number)))
    return told


@given(st.lists(st.lists(st.integers(), max_size=4), max_size=5))
def test_everybody_gets_what_it_would_get_alone(tasks):
    doubler = Doubler()
    results = side_by_side({index: work(doubler, numbers) for index, numbers in enumerate(tasks)})
    assert results == {index: [2 * number for number in numbers]
                       for index, numbers in enumerate(tasks)}
    assert list(results) == list(range(len(tasks)))
    # The first asks meet, then the second, and so on.
    assert doubler.asked == [
        [numbers[turn] for numbers in tasks if len(numbers) > turn]
        for turn in range(max(map(len, tasks), default=0))]


def test_asks_of_others_are_not_mixed():
    one, other = Doubler(), Doubler()
    side_by_side({1: work(one, [1], 'one'), 2: work(other, [2], 'other'),
                  3: work(one, [3], 'one')})
    assert (one.asked, other.asked) == ([[1, 3]], [[2]])


def test_work_alone_is_answered_at_once():
    doubler = Doubler()
    assert at_once(work(doubler, [1, 2])) == [2, 4] and doubler.asked == [[1], [2]]
    assert at_once(work(doubler, [])) == []


def test_too_few_answers_are_an_error():
    with pytest.raises(ValueError):
        side_by_side({1: work(lambda subjects: [], [1])})


def test_works_wait_for_each_other():
    done = []

    def walk(name, asks):
        told = []
        for number in range(asks):
            told.append((yield Ask('doubler', doubler, number)))
        done.append(name)
        yield from in_step()
        done.append(name.upper())
        return told

    doubler = Doubler()
    assert side_by_side({1: walk('a', 1), 2: walk('b', 1)}) == {1: [0], 2: [0]}
    assert done == ['a', 'b', 'A', 'B']
    done.clear()
    assert at_once(walk('c', 2)) == [0, 2] and done == ['c', 'C']


def test_answers_to_several_questions_are_those_to_each(rng, random_network):
    network = random_network(ExtentNet)
    questions = [(rng.random((3, 64, 64), dtype=np.float32),
                  torch.from_numpy(rng.random((1, 96, 8, 8), dtype=np.float32)),
                  (rng.uniform(2, 8), rng.uniform(2, 8))) for _ in range(3)]
    for question, answer in zip(questions, network.answers(questions), strict=True):
        alone, = network.answers([question])
        patch, reference, sides = question
        measured = network.measure(reference, network.encode(patch), torch.tensor([sides]))[0]
        assert answer.shape == (9,) and answer.dtype == np.float64
        np.testing.assert_allclose(answer, alone, atol=1e-5)
        np.testing.assert_allclose(answer, measured, atol=1e-5)

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

"""Ground truth as text: what is written in an accepted form is read, all else is refused."""

from hypothesis import example, given, strategies as st
import numpy as np
import pytest

from lmsco_ros.evaluation.datasets.boxes_text import read_boxes
from lmsco_ros.evaluation.errors import SequenceError

ABSENT = None
BOX, OTHER = [10, 20, 30, 40], [11, 21, 31, 41]
MOT = '{frame},{id},10,20,30,40,1,-1,-1,-1'


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    """Return a file to write to; one for all examples of a property."""
    return tmp_path_factory.mktemp('truth') / 'groundtruth.txt'


@pytest.fixture
def read(file):
    """Return a function that reads text as ground truth, absent targets as None."""
    def reader(text, encoding='utf-8', frames=None):
        file.write_bytes(text.encode(encoding))
        return plain(read_boxes(file, frames))
    return reader


def plain(boxes):
    """Return boxes as lists, None where they are absent as a whole."""
    assert (np.isnan(boxes).all(axis=1) | np.isfinite(boxes).all(axis=1)).all()
    return [ABSENT if np.isnan(row).any() else row.tolist() for row in boxes]


@pytest.mark.parametrize('text', [
    '10,20,30,40\n\n11,21,31,41\n', '10 20 30 40\n   \t\n11 21 31 41\n\n\n\n',
    '10,20,30,40\r\n\r\n11,21,31,41\r\n', '10,20,30,40\r\r\n\r\r\n11,21,31,41\r\r\n',
    '10,20,30,40\rnan\r11,21,31,41\r', '10;20;30;40\n;;;\n11;21;31;41',
    '10,20,30,40,\n,,,\n11,21,31,41,', '10\t20\t30\t40\nNaN\tNaN\tNaN\tNaN\n11\t21\t31\t41',
    '10, 20, 30, 40\n0\n11, 21, 31, 41', '10,20,30,40\n1\n11,21,31,41',
    '10,20,30,40\n2\n11,21,31,41', '10,20,30,40\n0,0,0,0\n11,21,31,41',
    '10,20,30,40\n-1,-1,-1,-1\n11,21,31,41', '10,20,30,40\n5,6,0,7\n11,21,31,41',
    '10,20,30,40\n5,nan,8,7\n11,21,31,41', '+1e1,2.0E+1,30.,40\n-nan(ind)\n11,21,31,41',
    'x,y,w,h\n10,20,30,40\n\n11,21,31,41', '# x y w h\n10 20 30 40\n0\n11 21 31 41\n# end',
    '% MATLAB\n// and C\n10 20 30 40\n# a remark\nnan\n11 21 31 41',
    'frame;x;y;width;height\n1;10;20;30;40\n3;11;21;31;41',
    'frame,x,y,width,height\n0,10,20,30,40\n2,11,21,31,41',
    'id,"conf","y","x","h","w"\n7,1,20,10,40,30\n7,0,1,1,9,9\n7,1,21,11,41,31',
    'xmin,ymin,xmax,ymax\n10,20,40,60\nnan,nan,nan,nan\n11,21,42,62',
    'x1,y1,x2,y2,x3,y3\n10,20,40,20,40,60\n0\n11,21,42,21,42,62',
    '10,20,40,20,40,60,10,60\n0\n11,21,31,41', '10,20,40,20,40,60\n\n11,21,42,21,42,62',
    '1,1,10,20,30,40,1\n3,1,11,21,31,41,1', '1,9,10,20,30,40,1,1,0.5\n3,9,11,21,31,41,1,1,0.5',
    '1,1,10,20,30,40,1,1\n2,1,1,1,9,9,0,1\n3,1,11,21,31,41,1,1',
    '1,-1,10,20,30,40,87,-1,-1,-1\n3,-1,11,21,31,41,3,-1,-1,-1',
    '3,1,11,21,31,41,1,-1,-1,-1\n1,1,10,20,30,40,1,-1,-1,-1\n\n',
], ids=lambda text: text[:24])
def test_a_target_that_is_away_in_the_second_of_three_frames(read, text):
    assert read(text) == [BOX, ABSENT, OTHER]


@pytest.mark.parametrize('encoding', ['utf-8-sig', 'utf-16', 'utf-32'])
def test_byte_order_marks_are_no_part_of_a_number(read, encoding):
    assert read('10,20,30,40\n11,21,31,41\n', encoding) == [BOX, OTHER]


@pytest.mark.parametrize('text', [
    '12,5;30,0;16,0;24,05\n13,5;30,5;16,0;24,0', '12,5\t30,0\t16\t24,05\n13,5\t30,5\t16\t24',
    '12,5 30,0 16,0 24,05\n13,5 30,5 16,0 24,0', '12,50;30,00;16,00;24,05\n13,5;30,5;16;24',
    'x;y;w;h\n1,25e1;30;16;24,05\n13,5;30,5;16;24',
    '1;4;12,5;30;16,0;24,05;1;-1;-1;-1\n2;4;13,5;30,5;16,0;24,0;1;-1;-1;-1',
])
def test_decimal_commas_beside_other_separators(read, text):
    assert read(text) == [[12.5, 30, 16, 24.05], [13.5, 30.5, 16, 24]]


def test_commas_that_part_the_numbers_stay_what_they_are(read):
    assert read('10,20 30,40') == [BOX]
    assert read('10.5,20;40.5,20;40.5,60;10.5,60') == [[10.5, 20, 30, 40]]
    assert read('10,20 40,20 40,60 20,65 10,60') == [[10, 20, 30, 45]]
    assert read('10, 20, 30, 40\n10,20,30,40') == [BOX, BOX]


def test_rows_of_mot_reach_to_the_end_of_the_sequence(read):
    rows = MOT.format(frame=2, id=4)
    assert read(rows, frames=4) == [ABSENT, BOX, ABSENT, ABSENT]
    assert read(rows) == [ABSENT, BOX]
    with pytest.raises(SequenceError, match='line 1.*there are 1 frames only'):
        read(rows, frames=1)
    assert read('10,20,30,40', frames=3) == [BOX]


@pytest.mark.parametrize(('text', 'reason'), [
    ('', 'holds no row'), ('\n \n', 'holds no row'), ('# nothing', 'holds no row'),
    ('10,20,30,40\n10,20,30', 'line 2, .10,20,30.: 3 numbers'),
    ('10,20,30,40\n5', 'line 2.*1 numbers'), ('10,20,30,40,1', 'line 1.*5 numbers'),
    ('10,20,30,40\n1,2,nan', 'line 2.*3 numbers'),
    ('10,20,30,40\n10,20,thirty,40', 'line 2.*thirty. is no number'),
    ('10,20,30,40\n10,20,,40', 'line 2.*a number is missing'),
    ('10,20,30,40\n1_0,20,30,40', "line 2.*'1_0' is no number"),
    ('10,20,30,40\n10,20,inf,40', 'line 2.*no number'),
    ('10,20,30,40\n10,20,1e400,40', 'line 2.*no image'),
    ('10,20,30,40\n10,20,-30,40', 'line 2.*below zero'),
    ('m10,20,5,5,3', 'line 1.*no number'), ('left 20 30 40', 'line 1.*no number'),
    ('1.234,5;20;30;40', 'line 1'), ('12,5;30;16,0', 'line 1'),
    ('10,20;40,20;40,60;10,60', 'line 1.*could be decimal ones'),
    ('10,20,30,40\n#11,21,31,41\n10,20,30,40', 'line 2.*as a comment'),
    ('# made by hand\n\n10,20,30,40', 'line 2.*head of the file'),
    ('x,y,w,h\n\n10,20,30,40', 'line 2.*head of the file'),
    ('cx,cy,w,h\n10,20,30,40', "header 'cx,cy,w,h' is not understood"),
    ('x,y,w,h,visible\n10,20,30,40,0', 'header .* is not understood'),
    ('x,x,w,h\n10,20,30,40', 'header .* is not understood'),
    ('x,y,w,h\n10,20,30,40,1', 'line 2.*5 numbers where 4'),
    ('nothing\n10,20,30,40', "header 'nothing'"),
    (f'{MOT.format(frame=1, id=2)}\n{MOT.format(frame=1, id=5)}', r'line 2.*2 targets \(ids 2, 5'),
    ('1,2,10,20,30,40,1,1,1\n1,3,10,20,30,40,1,1,1\n2,2,10,20,30,40,1,1,1\n2,3,9,9,9,9,1,1,1',
     r'ids 2, 3'),
    (f'{MOT.format(frame=1, id=2)}\n{MOT.format(frame=1, id=2)}', 'line 2.*has a row already'),
    (f'{MOT.format(frame=1, id=2)}\n{MOT.format(frame=10**6 + 1, id=2)}', 'line 2.*whole one'),
    (f'{MOT.format(frame=1, id=2)}\n10,20,30,40', 'line 2'),
    (f'{MOT.format(frame=1, id=2)}\n0', 'line 2'),
    ('frame,x,y,w,h\n1.5,10,20,30,40', 'line 2.*whole one'),
    ('1,5,11,5,11,15,1,15', 'line 1.*say which by a header'),
    ('1,1,10,20,30,40,87,1\n2,1,11,20,30,40,88,1', 'line 1.*say which by a header'),
    ('1,1,10,20,30,40\n2,1,11,20,30,40', 'line 1.*say which by a header'),
])
def test_all_else_is_refused_with_the_row_and_what_is_accepted(read, text, reason):
    with pytest.raises(SequenceError, match=f'groundtruth.txt: .*{reason}') as refusal:
        read(text)
    assert 'x,y,width,height, the corners of a polygon' in str(refusal.value)
    assert '\n' not in str(refusal.value)


def test_text_without_a_known_encoding_is_refused(read):
    with pytest.raises(SequenceError, match='save it as UTF-8'):
        read('10,20,30,40\n', 'utf-16-le')


coordinates = st.integers(0, 4000).map(lambda number: number / 4)
sizes = st.integers(1, 2000).map(lambda number: number / 4)
boxes = st.tuples(coordinates, coordinates, sizes, sizes).map(list)
truths = st.lists(st.one_of(boxes, st.none()), max_size=8)


@st.composite
def written(draw):
    """Return boxes and a text that says them in one of the accepted ways."""
    decimal = draw(st.sampled_from('.,'))
    separator = draw(st.sampled_from([';', '\t', ' ', '; '] + [',', ', '] * (decimal == '.')))
    absent = draw(st.sampled_from(['', 'nan', '0', separator.join('0' * 4),
                                   separator.join(['NaN'] * 4)]))
    truth = [[0.25, 8, 2, 3], *draw(truths), [1, 2, 3, 4.5]]
    rows = [separator.join(f'{number:.3f}'.replace('.', decimal) for number in box) if box
            else absent for box in truth]
    head = draw(st.sampled_from(['', separator.join('xywh') + '\n', '# remark\n']))
    end = draw(st.sampled_from(['\n', '\r\n', '\r']))
    encoding = draw(st.sampled_from(['utf-8', 'utf-8-sig', 'utf-16']))
    tail = '\n' * draw(st.integers(0, 3))
    return truth, (head + '\n'.join(rows) + tail).replace('\n', end), encoding


@given(written())
def test_what_is_written_is_read(file, sample):
    truth, text, encoding = sample
    file.write_bytes(text.encode(encoding))
    assert plain(read_boxes(file)) == truth


@given(st.dictionaries(st.integers(1, 30), boxes, min_size=1), st.integers(-1, 9),
       st.integers(7, 10), st.sampled_from([',', ' ', ';']))
def test_one_target_of_mot_is_read_by_its_frames(file, placed, identity, columns, separator):
    placed[1] = [1.0, 2.0, 3.0, 4.0]
    rows = [[frame, identity, *box, 1, 1, 0.5, -1][:columns] for frame, box in placed.items()]
    if columns == 10:
        rows = [[*row[:7], -1, -1, -1] for row in rows]
    else:
        rows.sort()
    file.write_text('\n'.join(separator.join(map(str, row)) for row in rows))
    assert plain(read_boxes(file)) == [placed.get(frame) for frame in range(1, max(placed) + 1)]


points = st.tuples(st.integers(2, 500), st.integers(2, 500))


@given(st.lists(st.integers(3, 6).flatmap(
    lambda corners: st.lists(points, min_size=corners, max_size=corners)), min_size=1, max_size=6))
@example([[(2, 5), (12, 5), (12, 15), (2, 15)], [(3, 5), (13, 5), (13, 15), (3, 15)]])
@example([[(2, 5), (12, 6), (11, 15), (2, 14)], [(3, 5), (13, 6), (12, 15), (3, 14)]])
def test_corners_are_never_taken_for_rows_of_mot(file, polygons):
    file.write_text('\n'.join(','.join(f'{x},{y}' for x, y in corners) for corners in polygons))
    try:
        found = plain(read_boxes(file))
    except SequenceError as error:
        assert 'say which by a header' in str(error)
        return
    expected = []
    for corners in polygons:
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        expected.append([*low, *(high - low)] if (high > low).all() else ABSENT)
    assert found == expected


@given(st.lists(st.tuples(points, points, points).filter(
    lambda corners: all(high > low for low, high in zip(np.min(corners, 0), np.max(corners, 0)))),
    min_size=1, max_size=5))
def test_parallelograms_are_read_as_corners(file, halves):
    rows, expected = [], []
    for first, second, third in np.array(halves):
        corners = np.array([first, second, third, first + third - second])
        rows.append(' '.join(map(str, corners.ravel())))
        expected.append([*corners.min(axis=0), *np.ptp(corners, axis=0)])
    file.write_text('\n'.join(rows))
    try:
        assert plain(read_boxes(file)) == expected
    except SequenceError as error:
        assert 'say which by a header' in str(error)


@given(st.one_of(st.text(), st.text('0123456789.,;-+ \t\r\nenaxywh#', max_size=80),
                 st.lists(st.sampled_from(['1', '0', '7.5', '2,5', ',', ';', ' ', '\n', '-1',
                                           '1,1,10,20,30,40,1,-1,-1,-1\n', 'nan', 'x,y,w,h\n',
                                           '1e9', '10,20,30,40\n']), max_size=30).map(''.join)))
@example('10,20,30,40\x0b11,21,31,41')
@example('1,2,3,4\n' + '9' * 5000 + ',1,1,1')
def test_any_text_is_read_or_refused(file, text):
    file.write_bytes(text.encode('utf-8', 'surrogatepass'))
    try:
        found = read_boxes(file)
    except SequenceError:
        return
    assert found.shape[1:] == (4,) and len(found)
    lines = text.replace('\r\n', '\n').replace('\r', '\n').rstrip().split('\n')
    named = not set(lines[0] + lines[-1]).isdisjoint('xywh#')
    if not named and max(len(line.replace(',', ' ').split()) for line in lines) < 7:
        assert len(found) == len(lines)


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(file, content):
    file.write_bytes(content)
    try:
        assert read_boxes(file).shape[1:] == (4,)
    except SequenceError as error:
        assert 'groundtruth.txt' in str(error)

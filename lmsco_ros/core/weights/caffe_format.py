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

"""Arrays of the binary files of Caffe, read by what is fixed of their format."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass
import numpy as np

from lmsco_ros.core.errors import WeightsError

__all__ = ['read_caffemodel']

_PACKAGE = 'lmsco_ros.caffe'
# Only what is needed to find arrays; all other fields are skipped as unknown. For each message:
# field, number, type (a name: another message), repeated.
_MESSAGES: dict[str, tuple[tuple[str, int, str, bool], ...]] = {
    'Shape': (('dim', 1, 'int64', True),),
    'Blob': (('num', 1, 'int32', False), ('channels', 2, 'int32', False),
             ('height', 3, 'int32', False), ('width', 4, 'int32', False),
             ('data', 5, 'float', True), ('shape', 7, 'Shape', False),
             ('double_data', 8, 'double', True)),
    'OldLayer': (('name', 4, 'string', False), ('blobs', 6, 'Blob', True)),
    'Layer': (('name', 1, 'string', False), ('blobs', 7, 'Blob', True)),
    'Network': (('name', 1, 'string', False), ('layers', 2, 'OldLayer', True),
                ('layer', 100, 'Layer', True)),
}


def read_caffemodel(path: Path) -> dict[str, np.ndarray]:
    """
    Return kernels (out, in / groups, kh, kw) and biases (out,) of all layers.

    Layers of both generations are read, and blobs with four fixed dimensions as well as those
    with a shape.

    Raises
    ------
    WeightsError
        When the file is damaged or holds no layer with arrays.

    """
    network: Any = _network_message()()
    try:
        network.ParseFromString(path.read_bytes())
    except DecodeError as error:
        raise WeightsError(f'{path} is damaged, or no file of Caffe ({error}); '
                           'get it again') from error
    arrays: dict[str, np.ndarray] = {}
    for layer in (*network.layers, *network.layer):
        for part, blob in zip(('weight', 'bias'), layer.blobs):
            array = _blob_array(blob, path, f'{layer.name}.{part}')
            arrays[f'{layer.name}.{part}'] = array.reshape(-1) if part == 'bias' else array
    if not arrays:
        raise WeightsError(f'{path} holds no layer with arrays; expected a trained network of '
                           'Caffe (.caffemodel), not its definition')
    return arrays


def _blob_array(blob: Any, path: Path, name: str) -> np.ndarray:
    """Return the array of a blob."""
    shape = (tuple(blob.shape.dim) if blob.HasField('shape')
             else (blob.num, blob.channels, blob.height, blob.width))
    numbers = np.array(blob.double_data or blob.data, np.float32)
    if min(shape, default=0) < 0 or numbers.size != math.prod(shape):
        raise WeightsError(f'{path}: array {name} has {numbers.size} numbers for the shape '
                           f'{shape}; the file is damaged, get it again')
    return numbers.reshape(shape)


def _network_message() -> type[Message]:
    """Return the class of the outermost message of a file."""
    file = FileDescriptorProto(name='lmsco_ros/caffe.proto', package=_PACKAGE, syntax='proto2')
    for name, fields in _MESSAGES.items():
        message = file.message_type.add(name=name)
        for field, number, kind, repeated in fields:
            _add_field(message.field.add(name=field, number=number), kind, repeated)
    pool = DescriptorPool()
    pool.AddSerializedFile(file.SerializeToString())
    return GetMessageClass(pool.FindMessageTypeByName(f'{_PACKAGE}.Network'))


def _add_field(field: FieldDescriptorProto, kind: str, repeated: bool) -> None:
    """Fill in the type of a field."""
    field.label = (FieldDescriptorProto.LABEL_REPEATED if repeated
                   else FieldDescriptorProto.LABEL_OPTIONAL)
    if kind in _MESSAGES:
        field.type, field.type_name = FieldDescriptorProto.TYPE_MESSAGE, f'.{_PACKAGE}.{kind}'
    else:
        field.type = FieldDescriptorProto.Type.Value(f'TYPE_{kind.upper()}')
        field.options.packed = repeated

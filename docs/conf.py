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
Settings of Sphinx; `make docs` builds the pages into `build/docs`.

rosdoc2 runs this text from a copy elsewhere: no path in here may depend on where it lies.
"""

from importlib.metadata import version as version_of
import re

project = 'lmsco_ros'
author = 'lmsco_ros contributors'
copyright = '2026, lmsco_ros contributors'  # noqa: A001
release = version = version_of('lmsco_ros')

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.autosummary',
              'sphinx.ext.napoleon']
templates_path = ['_templates']
exclude_patterns = ['_templates', '_static']
myst_heading_anchors = 3

# Classes of two packages may share a name; a type in the text then leads to none of them.
suppress_warnings = ['ref.python']

autosummary_generate = True
autodoc_member_order = 'bysource'
autodoc_typehints = 'signature'
add_module_names = False
napoleon_google_docstring = False
# Types are text for people, such as a shape; their words are no names.
napoleon_use_ivar = napoleon_use_param = napoleon_use_rtype = False

html_theme = 'alabaster'
html_theme_options = {
    'description': 'Track anything warm',
    'page_width': '1200px',
    'sidebar_width': '240px',
    'body_max_width': 'none',
    # A line of 99 characters fits.
    'code_font_size': '0.8em',
}
html_static_path = ['_static']
html_show_sourcelink = False


def skip_alias(app, what, name, item, skip, options):
    """Leave out what Python says of the fields of a named tuple; the class describes them."""
    return True if type(item).__name__ == '_tuplegetter' else None


def unlink_files(app, name, source):
    """Leave of links to files of the repository, which is not around the pages, the text."""
    source[0] = re.sub(r'(?<!!)\[([^\]]+)\]\(\.\./[^)]*\)', r'\1', source[0])


def setup(app):
    """Register the above."""
    app.connect('autodoc-skip-member', skip_alias)
    app.connect('source-read', unlink_files)

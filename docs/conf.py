# Copyright OmniBot driver developers. SPDX-License-Identifier: Apache-2.0

"""Settings of Sphinx for `make docs`. rosdoc2 also executes this file, with its own defaults.

Sphinx reads the whole repository, so that links work as on GitHub.
"""

project = "omnibot_driver"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_rtd_theme"]
myst_heading_anchors = 4
myst_enable_extensions = ["html_image"]
highlight_language = "none"
html_theme = "sphinx_rtd_theme"
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "description"

if "rosdoc2_settings" not in globals():
    root_doc = "docs/index"
    include_patterns = ["*.md", "CHANGELOG.rst", "docs/**"]
    exclude_patterns = [".*", "build", "install", "log"]
    html_extra_path = ["site"]
    html_show_copyright = False

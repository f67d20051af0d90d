"""The tiny project, for the tests of the glue."""

from tests.tiny import blank as blank
from tests.tiny import project as project

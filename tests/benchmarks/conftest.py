"""The tiny project, for the tests of the benchmarks."""

from tests.tiny import blank as blank

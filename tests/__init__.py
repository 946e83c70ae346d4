"""The tests are one package: run them from the root of the repository."""

import pytest

pytest.register_assert_rewrite("tests.support")

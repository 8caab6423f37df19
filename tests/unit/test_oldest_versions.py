"""The oldest libraries that pyproject.toml admits, with which the nightly tests fly."""

from __future__ import annotations

from tools.oldest_versions import constraints, of_users


def test_a_lower_bound_is_a_constraint() -> None:
    given = ["numpy>=2.0", "mavsdk>=4.1,<5", "dask[complete]>=2026.1", "flightstack[test]", "sympy"]
    assert constraints(given) == ["numpy==2.0", "mavsdk==4.1", "dask==2026.1"]


def test_all_that_users_install_has_a_lower_bound() -> None:
    assert [item for item in of_users() if not constraints([item])] == []

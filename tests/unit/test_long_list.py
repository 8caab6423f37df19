"""``tests/long.txt``, the tests that ``make test`` leaves out, names tests that exist."""

from __future__ import annotations

import re

from tools.long_tests import LIST, ROOT


def test_the_list_names_tests_that_exist() -> None:
    gone, contents = [], dict[str, str]()
    for name in LIST.read_text(encoding="utf-8").splitlines():
        file, _, test = name.partition("::")
        path = ROOT / file
        if file not in contents:
            contents[file] = path.read_text(encoding="utf-8") if path.is_file() else ""
        function = re.split(r"::|\[", test)[0]
        if not contents[file] or (path.suffix == ".py" and not re.search(rf"\b{function}\b", contents[file])):
            gone.append(name)
    assert not gone, "run python -m tools.long_tests"


def test_the_list_is_sorted_and_names_each_test_once() -> None:
    names = LIST.read_text(encoding="utf-8").splitlines()
    assert names == sorted(set(names))

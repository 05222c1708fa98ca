"""A skip that nobody listed fails continuous integration; one that is listed does not."""

from __future__ import annotations

from pathlib import Path

import allowed_skips
import pytest

HERE = Path(__file__).resolve().parent


@pytest.mark.parametrize(
    ("reason", "strict", "failed"),
    [
        ("a reason that nobody listed", "1", True),
        ("a reason that nobody listed", "0", False),
        ("the extra 'distributed' is not installed", "1", False),
    ],
)
@pytest.mark.parametrize("whole_module", [False, True], ids=["test", "module"])
def test_only_listed_skips_pass(
    pytester: pytest.Pytester,
    monkeypatch: pytest.MonkeyPatch,
    reason: str,
    strict: str,
    failed: bool,
    whole_module: bool,
) -> None:
    monkeypatch.setenv(allowed_skips.STRICT, strict)
    pytester.makeconftest(
        (HERE / "conftest.py").read_text(encoding="utf-8").replace("install_import_hook(", "(lambda *_: 0)(")
    )
    pytester.makepyfile(allowed_skips=(HERE / "allowed_skips.py").read_text(encoding="utf-8"))
    call = f"pytest.skip({reason!r}, allow_module_level=True)"
    body = call if whole_module else f"def test_skipped():\n    {call}"
    pytester.makepyfile(
        test_passing="def test_passes():\n    assert True\n", test_skipping=f"import pytest\n\n{body}\n"
    )
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    assert (result.ret != 0) is failed
    if failed:
        result.stdout.fnmatch_lines([f"*{reason}*"])


def test_each_entry_of_the_list_says_why() -> None:
    for entry in allowed_skips.ALLOWED:
        assert len(entry.why) > 20
        assert entry.says

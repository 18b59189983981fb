"""`--report` of the commands whose answers have pictures of their own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.program import complains, run

ASKED = {
    "robust": (
        ["fig9", "--direction", "0", "0", "1", "--normals", "1", "--samples", "2"],
        ["How much force along +z does it resist as it stands?", "normals 1°; seed 0"],
    ),
    "measures": (["fig11", "--no-passive"], ["force closure", "0.5745"]),
    "simulate": (
        ["fig11", "--wrench", "0", "0", "0.5", "--ramp", "0.1"],
        ["HOLDS: fig11 under 0.5 N along +z.", "At rest after"],
    ),
}


@pytest.mark.parametrize("name", ASKED)
def test_a_page_has_the_answer_and_its_picture(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    options, says = ASKED[name]
    question = [name, *options, "--report", "page.html"]
    status, out, _ = run(capsys, *question)
    assert status == 0
    assert "Written: page.html" in out
    page = Path("page.html").read_text("utf-8")
    assert page.count("data:image/png") > 0 or page.count("<svg") > 0
    for text in says:
        assert text in page
    complains(capsys, question, ["page.html", "exists already", "--force"])

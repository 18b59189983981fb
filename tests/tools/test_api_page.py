"""The page of the Python API says what each name is, for those who read it unbuilt."""

from __future__ import annotations

from tools.api_page import GROUP, HEAD, PAGE, listed, names, thing


def test_every_group_of_names_has_a_table_of_them() -> None:
    text = PAGE.read_text("utf-8")
    groups = list(GROUP.finditer(text))
    assert len(groups) > 10
    for group in groups:
        assert group[0].startswith(HEAD), f"run tools/api_page.py: no table above {group[0][:60]}"
        rows = [line.split("`")[1] for line in group[0][len(HEAD) :].splitlines() if line.startswith("| ")]
        assert rows == [name.rpartition(".")[2] for name in names(group[1])], "run tools/api_page.py"
        assert all(thing(name).__doc__ for name in names(group[1]))


def test_the_tables_are_written_once() -> None:
    plain = "Words.\n\n::: handfast.stability.studies.questions.check\n"
    plain += "::: handfast.pictures\n    options:\n      members: [Entry]\n"
    once = listed(plain)
    assert once.startswith(f"Words.\n\n{HEAD}| `check` | Does the grasp resist a disturbance passively?")
    assert "| `Entry` | A question and its answer. |\n\n::: handfast.stability.studies.questions.check\n" in once
    assert listed(once) == once
    assert listed(once.replace("Does the", "What the")) == once

"""What the documents say is so: links lead somewhere, tests they name exist, numbers are the benchmark's."""

import json
import re
import subprocess
from pathlib import Path

import pytest

import benchmarks.readme as readme_table
from tests.data import ROOT

DOCUMENTS = ["README.md", "CONVENTIONS.md", "CHANGELOG.md", "docs/method.md", "docs/embedding.md", "docs/ptm.md"]
DOCUMENTS += ["docs/games.md", "docs/choosing.md", "docs/walk.md", "examples/README.md"]
PACKAGES = ("impostor", "bake", "runtime")


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_lead_somewhere(name):
    text = (ROOT / name).read_text()
    targets = [target for target in re.findall(r"\]\(([^)#\s]+)\)", text) if "://" not in target]
    missing = [target for target in targets if not ((ROOT / name).parent / target).exists()]
    assert not missing


def test_nothing_is_left_of_a_merge():
    marks = re.compile(r"^(<{7}|>{7}) ", re.MULTILINE)
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("examples/*.md"), *ROOT.glob("scenes/*.toml")]
    assert len(pages) > 10 and not [page.name for page in pages if marks.search(page.read_text())]


def test_every_convention_has_its_test():
    named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", (ROOT / "CONVENTIONS.md").read_text())
    assert len(named) > 15
    for file, test in named:
        source = (ROOT / file).read_text()
        assert not test or f"def {test}(" in source, f"{file}::{test}"


def test_one_word_per_thing():
    words = re.compile(r"\b(sprites?|billboards?)\b", re.IGNORECASE)
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.suffix in (".py", ".md")]
    used = [str(path) for path in files if words.search(path.read_text())]
    assert not used


def test_the_two_commands_of_the_readme_are_targets():
    makefile = (ROOT / "Makefile").read_text()
    for command in re.findall(r"^ {4}make (\w+)", (ROOT / "README.md").read_text(), re.MULTILINE):
        assert re.search(rf"^{command}:", makefile, re.MULTILINE), command


def test_set_up_a_second_time_does_nothing():
    done = subprocess.run(["tools/setup.sh"], cwd=ROOT, capture_output=True, text=True, timeout=3, check=True)
    assert done.stdout + done.stderr == ""


def test_nothing_names_an_address_or_a_machine():
    """Pinned names and versions only: no registry, no path of one machine."""
    places = re.compile(r"https?://(?!www\.w3|json-schema|creativecommons)|/root/|/home/\w")
    kinds = ("*.toml", "*.txt", "Makefile", "*.sh")
    files = [path for kind in kinds for path in Path(ROOT).glob(kind)] + list((ROOT / "tools").iterdir())
    assert not [str(path) for path in files if places.search(path.read_text())]


def test_the_numbers_of_the_readme_are_the_benchmarks():
    results = json.loads(readme_table.RESULTS.read_text())
    for page, make in readme_table.PAGES:
        text = page.read_text()
        assert readme_table.with_table(text, make(results)) == text


def test_what_the_method_says_of_the_dragon_is_measured():
    rows = json.loads(readme_table.RESULTS.read_text())[readme_table.MACHINE]["tables"]["quality"]["rows"]
    at = [round(rows[f"dragon/{degrees}"]["values"]["psnr_db"]) for degrees in (0, 5, 20)]
    said = f"the dragon falls from {at[0]} dB to {at[1]} at 5 degrees and to {at[2]} at 20"
    assert said in " ".join((ROOT / "docs/method.md").read_text().split())


def test_what_the_page_on_ptms_says_of_robust_fits_is_measured():
    rows = json.loads(readme_table.RESULTS.read_text())[readme_table.MACHINE]["tables"]["ptm"]["rows"]
    values = {key: row["values"] for key, row in rows.items()}
    sets = {key.rsplit(" ", 1)[0] for key in rows}
    off = [100 * (1 - values[f"{name} robust"]["normals_deg"] / values[f"{name} rgb"]["normals_deg"]) for name in sets]
    decibels = [values[f"{name} robust"]["psnr_db"] - values[f"{name} lrgb"]["psnr_db"] for name in sets]
    text = " ".join((ROOT / "docs/ptm.md").read_text().split())
    assert f"takes {min(off):.0f} to {max(off):.0f} percent off their error" in text
    assert f"changes the PSNR by {min(decibels):.1f} to {max(decibels):+.1f} dB" in text

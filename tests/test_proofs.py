"""The table of statistical proofs is that of the tests' names and marks; run this to print it."""

import ast
from pathlib import Path

TESTS = Path(__file__).parent
PAGE = TESTS.parent / "notebooks" / "docs" / "development" / "proofs.md"


def rows():
    """File, what a test proves, and whether its cases are quick or slow, in the order of files."""
    for path in sorted(TESTS.rglob("test_*.py")):
        body = ast.parse(path.read_text()).body
        of_file = {ast.unparse(x.value) for x in body if ast.unparse(x).startswith("pytestmark =")}
        for test in body:
            if not isinstance(test, ast.FunctionDef) or not test.name.startswith("test_"):
                continue
            own = [ast.unparse(one) for one in test.decorator_list]
            if "mark.statistical" in str([*own, *of_file]):
                is_slow = "pytest.mark.slow" in own or "mark.slow" in str(of_file)
                when = "slow" if is_slow else "quick, some slow" if "slow" in str(own) else "quick"
                file = path.relative_to(TESTS).with_suffix("").as_posix().replace("test_", "")
                yield f"| {file} | {test.name[5:].replace('_', ' ')} | {when} |"


def test_every_statistical_proof_stands_in_the_table():
    table = [line for line in PAGE.read_text().splitlines() if line.startswith("|")]
    assert table[2:] == list(rows())


if __name__ == "__main__":
    print(*rows(), sep="\n")

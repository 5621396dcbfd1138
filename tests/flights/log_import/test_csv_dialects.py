"""Forms of CSV files: encodings, separators, decimal commas, quotes, comments and equal times."""

import codecs

import numpy as np
import pytest

from lapwing.flights.log_import.csv_table import read_columns

ROWS = [(0.0, 1.5, -2.25), (0.01, 1.75, -2.5)]
PLAIN = "t,x,y\n" + "".join(",".join(map(str, row)) + "\n" for row in ROWS)
DECIMAL = "t;x;y\n" + "".join(";".join(map(str, row)).replace(".", ",") + "\n" for row in ROWS)
QUOTED = '"t","x","y"\n' + "".join(",".join(f'"{v}"'.replace(".", ",") for v in row) + "\n" for row in ROWS)


@pytest.mark.parametrize(
    "content",
    [
        codecs.BOM_UTF8 + PLAIN.encode(), PLAIN.encode("utf-16"), PLAIN.replace(",", ";").encode(),
        PLAIN.replace(",", "\t").encode(), DECIMAL.encode(), QUOTED.encode(), b"# of a logger\n" + PLAIN.encode(),
        b"# " + PLAIN.encode(), PLAIN.replace("0.01", "# pause\n0.01").encode(),
    ],
    ids=["bom", "utf16", "semicolon", "tab", "decimal", "quoted", "comment", "header", "rows"],
)  # fmt: skip
def test_form_of_file_is_recognised(tmp_path, content):
    (tmp_path / "f.csv").write_bytes(content)
    table = read_columns(tmp_path / "f.csv", ("t", "x", "y"))
    assert np.column_stack([table["t"], table["x"], table["y"]]) == pytest.approx(np.array(ROWS))


def test_decimal_commas_between_commas_are_named(tmp_path):
    (tmp_path / "f.csv").write_text("t,x\n0,0,1,5\n0,01,1,75\n")
    with pytest.raises(ValueError, match="decimal commas are suspected; separate the fields by semicolons"):
        read_columns(tmp_path / "f.csv", ("t", "x"))

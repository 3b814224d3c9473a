"""``eutree demos study``: what came of a study."""

from pathlib import Path

import click

from eutree.cli._options import count_option, json_option, output_option
from eutree.cli._output import Output


@click.command(epilog="Example: eutree demos study people/ --csv people.csv")
@click.argument("folder", type=click.Path(path_type=Path))
@count_option("--episodes", 500, "How many further episodes each tree plays.")
@output_option("--csv", text="File to write: one row for each person.")
@json_option
def study(folder: Path, episodes: int, csv: Path | None, as_json: bool) -> None:
    """Print what the people of a study reached, and their trees; see `record --study`."""
    from eutree.files import write_text
    from eutree.fitting.study_table import study_table

    table = study_table(folder, episodes=episodes)
    if csv is not None:
        write_text(csv, table.to_csv())
    found = {"people": list(table.rows), "means": table.means(), "questions": table.questions}
    Output(as_json=as_json).result(found, str(table))

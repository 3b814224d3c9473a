"""``--help`` in one screen, and ``--help-all`` with every option in its group."""

from collections.abc import Mapping, Sequence
from typing import Any

import click

_FULL = "eutree.help_all"  # in click's context: every option is to be shown
_SHARED: Mapping[str, Sequence[str]] = {
    "The environment": ("env_arguments", "decode", "action_grid", "import", "names", "strict"),
    "Several processes": ("n_jobs", "backend", "address"),
    "Everywhere": ("seed", "as_json", "help_all", "help"),
}


class Helped(click.Command):
    """A command with many options, of which ``--help`` shows those that come first.

    Args:
        arguments: As click has them.
        groups: Names of parameters under the heading of each group; others are *Options*.
        brief: Names of the parameters that ``--help`` shows; by default all but those that every
            command has for environments and processes.
        more: As click has them.
    """

    def __init__(
        self,
        *arguments: Any,
        groups: Mapping[str, Sequence[str]] | None = None,
        brief: Sequence[str] = (),
        **more: Any,
    ) -> None:
        super().__init__(*arguments, **more)
        self._groups = {**(groups or {}), **_SHARED}
        self._brief = brief
        self.params.append(
            click.Option(
                ["--help-all"],
                is_flag=True,
                is_eager=True,
                expose_value=False,
                callback=_show_all,
                help="Show every option, and exit.",
            )
        )

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options: all in their groups, or the first ones."""
        records = {
            "help" if "--help" in one.opts else str(one.name): record
            for one in self.get_params(ctx)
            if isinstance(one, click.Option) and (record := one.get_help_record(ctx)) is not None
        }
        if not ctx.meta.get(_FULL):
            with formatter.section("Options"):
                formatter.write_dl([records[name] for name in records if self._is_first(name)])
            if (hidden := len(records) - sum(map(self._is_first, records))) > 0:
                formatter.write_paragraph()
                formatter.write_text(f"{ctx.command_path} --help-all shows {hidden} more.")
            return
        grouped = {name for names in self._groups.values() for name in names}
        others = {"Options": [name for name in records if name not in grouped]}
        for heading, names in {**others, **self._groups}.items():
            shown = [records[name] for name in names if name in records]
            if shown:
                with formatter.section(heading):
                    formatter.write_dl(shown)

    def _is_first(self, name: str) -> bool:
        if name in ("help", "help_all"):
            return True
        if self._brief:
            return name in self._brief
        return name in _SHARED["Everywhere"] or not any(name in of for of in _SHARED.values())


def _show_all(context: click.Context, parameter: click.Parameter, asked: bool) -> None:
    """Print the whole help and end the command."""
    if asked and not context.resilient_parsing:
        context.meta[_FULL] = True
        click.echo(context.get_help(), color=context.color)
        context.exit()

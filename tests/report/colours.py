"""What colours a page really has in a browser, compared with its palette."""

import re
from typing import Any

from eutree.export.drawing import FILLS
from eutree.export.svg import STYLE
from eutree.report.html import asset

# Text on the light fill of an action is dark in both themes.
ON_FILLS = "#10161d"

# What the browser computed for all that is painted: [what, property, colour].
_PAINTED = """() => {
  const found = [];
  const say = (element, property, colour) => found.push(
    [element.outerHTML.slice(0, 120), property, colour]);
  for (const shape of document.querySelectorAll(
      "svg :is(path, rect, circle, ellipse, line, polyline, polygon, text)")) {
    const style = getComputedStyle(shape);
    if (!shape.checkVisibility()) continue;
    if (style.fill !== "none" && !["line"].includes(shape.localName))
      say(shape, "fill", style.fill);
    if (style.stroke !== "none") say(shape, "stroke", style.stroke);
    if (style.fill === "none" && style.stroke === "none" &&
        !shape.matches(".ring, .reach")) say(shape, "paint", "nothing");
    if (shape.localName === "line" && style.stroke === "none") say(shape, "paint", "nothing");
  }
  for (const element of document.querySelectorAll("body, body *:not(svg, svg *)")) {
    if (!element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    if (!element.matches("input:not([type=search]), option")) say(element, "color", style.color);
    if (style.backgroundColor !== "rgba(0, 0, 0, 0)" && !element.matches("input, select, button"))
      say(element, "background", style.backgroundColor);
  }
  return found;
}"""

_UNDEFINED = """() => {
  const names = [...document.querySelectorAll("style")]
    .flatMap(style => [...style.textContent.matchAll(/var\\((--[\\w-]+)/g)]).map(match => match[1]);
  const root = getComputedStyle(document.documentElement);
  return [...new Set(names)].filter(name => !root.getPropertyValue(name).trim());
}"""


def palette(scheme: str) -> set[str]:
    """Return every colour that a page may have in a theme, as browsers write it."""
    light, _, dark = asset("colours.css").partition(
        "@media screen and (prefers-color-scheme: dark)"
    )
    drawn, _, drawn_dark = STYLE.partition("@media (prefers-color-scheme: dark)")
    colours = dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6});", light))
    drawing = dict(re.findall(r"(\.eutree-[^{]*?)\s*\{[^}]*?(#[0-9a-f]{6})", drawn))
    texts = [*re.findall(r"#[0-9a-f]{6}", drawn), *drawing.values()]
    if scheme == "dark":
        colours |= dict(re.findall(r"(--[\w-]+): (#[0-9a-f]{6});", dark))
        texts = [*re.findall(r"#[0-9a-f]{6}", drawn_dark), ON_FILLS]
    return {rgb(colour) for colour in (*colours.values(), *texts, *FILLS, ON_FILLS)}


def rgb(colour: str) -> str:
    return "rgb({}, {}, {})".format(*(int(colour[at : at + 2], 16) for at in (1, 3, 5)))


def wrong_colours(page: Any, scheme: str) -> list[list[str]]:
    """Return what is painted in a colour that is not of the palette, or not painted at all."""
    known = palette(scheme) | {"rgba(0, 0, 0, 0)"}
    undefined = [[name, "var", "undefined"] for name in page.evaluate(_UNDEFINED)]
    return undefined + [entry for entry in page.evaluate(_PAINTED) if entry[2] not in known]

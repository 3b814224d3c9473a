"""PMML 4.4, the exchange format of scoring engines."""

from xml.sax.saxutils import escape, quoteattr

from eutree.policies import TreePolicy
from eutree.trees.text import quoted


def to_pmml(policy: TreePolicy) -> str:
    """Return a PMML ``TreeModel`` that predicts the name of the action.

    The second branch of each test has no condition of its own, so a missing value, which fails
    the first one, takes it. Names that XML cannot carry, and the empty one, which JPMML refuses,
    are written as JSON writes them. Where actions set quantities each is an output of its own.
    """
    schema = policy.schema
    features = _distinct([feature.name for feature in schema.features])
    actions = _distinct(list(schema.actions))
    target = _distinct([*features, "action"])[-1]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<PMML xmlns="http://www.dmg.org/PMML-4_4" version="4.4">',
        '<Header><Application name="eutree"/></Header>',
        f'<DataDictionary numberOfFields="{schema.n_features + 1}">',
    ]
    for name, feature in zip(features, schema.features, strict=True):
        label = f" displayName={_attribute(f'{name} [{_carried(feature.unit)}]')}"
        lines.append(
            f'<DataField name={_attribute(name)} optype="continuous" dataType="double"'
            f"{label if feature.unit else ''}/>"
        )
    lines.append(f'<DataField name={_attribute(target)} optype="categorical" dataType="string">')
    lines += [f"<Value value={_attribute(action)}/>" for action in actions]
    lines += [
        "</DataField>",
        "</DataDictionary>",
        '<TreeModel modelName="policy" functionName="classification" '
        'missingValueStrategy="none" splitCharacteristic="binarySplit">',
        "<MiningSchema>",
        *(f"<MiningField name={_attribute(name)}/>" for name in features),
        f'<MiningField name={_attribute(target)} usageType="target"/>',
        "</MiningSchema>",
        *_values(policy, [*features, target], actions),
        *_nodes(policy, features, actions),
        "</TreeModel>",
        "</PMML>",
    ]
    return "\n".join(lines) + "\n"


def _values(policy: TreePolicy, fields: list[str], actions: list[str]) -> list[str]:
    """Return the outputs: the action, and what it sets each control to."""
    schema = policy.schema
    if not schema.controls:
        return []
    names = [control.name for control in schema.controls]
    chosen, *outputs = _distinct([*fields, "chosen action", *names])[len(fields) :]
    lines = [
        "<Output>",
        f'<OutputField name={_attribute(chosen)} optype="categorical" dataType="string" '
        'feature="predictedValue"/>',
    ]
    for number, (output, control) in enumerate(zip(outputs, schema.controls, strict=True)):
        label = f" displayName={_attribute(_carried(control.label))}" if control.unit else ""
        rows = (
            f"<row><action>{escape(action)}</action><level>{levels[number]!r}</level></row>"
            for action, levels in zip(actions, schema.action_values, strict=True)
        )
        lines += [
            f'<OutputField name={_attribute(output)}{label} optype="continuous" '
            'dataType="double" feature="transformedValue">',
            '<MapValues outputColumn="level" dataType="double">',
            f'<FieldColumnPair field={_attribute(chosen)} column="action"/>',
            f"<InlineTable>{''.join(rows)}</InlineTable>",
            "</MapValues>",
            "</OutputField>",
        ]
    return [*lines, "</Output>"]


def _nodes(policy: TreePolicy, features: list[str], actions: list[str]) -> list[str]:
    """Return the nested nodes of the tree."""
    tree = policy.tree
    lines: list[str] = []
    work: list[int | str] = [0]
    while work:
        node = work.pop()
        if isinstance(node, str):
            lines.append(node)
            continue
        is_leaf = tree.feature[node] == tree.NO_FEATURE
        score = ""
        if is_leaf:
            score = f" score={_attribute(actions[policy.actions[tree.leaf[node]]])}"
        lines += [f'<Node id="{node}"{score}>', _predicate(policy, node, features)]
        work.append("</Node>")
        if not is_leaf:
            work += [int(tree.right[node]), int(tree.left[node])]
    return lines


def _predicate(policy: TreePolicy, node: int, features: list[str]) -> str:
    """Return the condition under which a node is entered from its parent."""
    tree = policy.tree
    parent = int(tree.parent[node])
    if parent == tree.NO_NODE or tree.left[parent] != node:
        return "<True/>"
    field = _attribute(features[tree.feature[parent]])
    threshold = repr(float(tree.threshold[parent]))
    return f'<SimplePredicate field={field} operator="lessOrEqual" value="{threshold}"/>'


def _attribute(text: str) -> str:
    """Return a quoted XML attribute."""
    return quoteattr(text, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def _distinct(names: list[str]) -> list[str]:
    """Return the names as XML can carry them, still distinct."""
    result: list[str] = []
    for name in names:
        carried = _carried(name)
        candidate, number = carried, 1
        while candidate in result:
            number += 1
            candidate = f"{carried} ({number})"
        result.append(candidate)
    return result


def _carried(text: str) -> str:
    """Return ``text`` if XML can carry it and engines take it, else a JSON string."""
    return text if text and all(map(_is_xml, text)) else quoted(text)


def _is_xml(sign: str) -> bool:
    """Return whether XML 1.0 can carry a character."""
    code = ord(sign)
    return (
        sign in "\t\n\r"
        or 0x20 <= code <= 0xD7FF
        or 0xE000 <= code <= 0xFFFD
        or 0x10000 <= code <= 0x10FFFF
    )

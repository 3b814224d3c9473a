"""ONNX with doubles: a ``TreeEnsemble`` whose splits and input are float64."""

import json
from types import ModuleType
from typing import Any

import numpy as np

from eutree.errors import needed
from eutree.export._code import ASSUMPTION
from eutree.policies import TreePolicy

_LESS_OR_EQUAL, _SUM, _NO_TRANSFORM = 0, 1, 0


def to_onnx(policy: TreePolicy) -> bytes:
    """Return an ONNX model: ``observation`` double [N, d] in, ``action`` int64 [N] out.

    It uses ``TreeEnsemble`` (ai.onnx.ml, operator set 5), which onnxruntime runs from 1.21 on.
    Feed float64: observations that were rounded to float32 may fall on the other side of a
    threshold. Names and units are in the model's metadata, as JSON. Where actions set K quantities
    there is a second output, ``value`` double [N, K].
    """
    onnx = _onnx()
    helper, tensor = onnx.helper, onnx.TensorProto
    info = helper.make_tensor_value_info
    nodes = [
        helper.make_node(
            "TreeEnsemble", ["observation"], ["index"], domain="ai.onnx.ml", **_ensemble(policy)
        ),
        helper.make_node("Cast", ["index"], ["column"], to=tensor.INT64),
        helper.make_node("Reshape", ["column", "vector"], ["action"]),
    ]
    inputs = [info("observation", tensor.DOUBLE, ["N", policy.tree.n_features])]
    outputs = [info("action", tensor.INT64, ["N"])]
    constants = [helper.make_tensor("vector", tensor.INT64, [1], [-1])]
    if policy.schema.controls:
        levels = np.array(policy.schema.action_values)
        constants.append(helper.make_tensor("levels", tensor.DOUBLE, levels.shape, levels.ravel()))
        nodes.append(helper.make_node("Gather", ["levels", "action"], ["value"], axis=0))
        outputs.append(info("value", tensor.DOUBLE, ["N", levels.shape[1]]))
    graph = helper.make_graph(nodes, "policy", inputs, outputs, constants)
    sets = [helper.make_opsetid("", 17), helper.make_opsetid("ai.onnx.ml", 5)]
    model = helper.make_model(graph, producer_name="eutree", opset_imports=sets, ir_version=8)
    helper.set_model_props(model, _metadata(policy))
    onnx.checker.check_model(model)
    content: bytes = model.SerializeToString(deterministic=True)
    return content


def _ensemble(policy: TreePolicy) -> dict[str, Any]:
    """Return the attributes of the one tree; inner nodes and leaves are numbered separately."""
    onnx, tree = _onnx(), policy.tree
    inner = np.flatnonzero(tree.feature != tree.NO_FEATURE)
    if inner.size == 0:  # the operator wants a split: one whose branches are the same leaf
        features, splits = np.array([0]), np.array([0.0])
        children = np.zeros((2, 1), dtype=np.int64)
        is_leaf = np.ones((2, 1), dtype=np.int64)
    else:
        features, splits = tree.feature[inner], tree.threshold[inner]
        nodes = np.stack([tree.left[inner], tree.right[inner]])
        is_leaf = (tree.feature[nodes] == tree.NO_FEATURE).astype(np.int64)
        children = np.where(is_leaf == 1, tree.leaf[nodes], np.searchsorted(inner, nodes))
    count, tensor, make = len(features), onnx.TensorProto, onnx.helper.make_tensor
    actions = policy.actions.astype(np.float64)
    return {
        "n_targets": 1,
        "aggregate_function": _SUM,
        "post_transform": _NO_TRANSFORM,
        "tree_roots": [0],
        "nodes_featureids": features.tolist(),
        "nodes_splits": make("splits", tensor.DOUBLE, [count], splits.tolist()),
        "nodes_modes": make("modes", tensor.UINT8, [count], [_LESS_OR_EQUAL] * count),
        "nodes_truenodeids": children[0].tolist(),
        "nodes_trueleafs": is_leaf[0].tolist(),
        "nodes_falsenodeids": children[1].tolist(),
        "nodes_falseleafs": is_leaf[1].tolist(),
        "leaf_targetids": [0] * policy.n_leaves,
        "leaf_weights": make("weights", tensor.DOUBLE, [policy.n_leaves], actions.tolist()),
    }


def _metadata(policy: TreePolicy) -> dict[str, str]:
    features, controls = policy.schema.features, policy.schema.controls
    set_by = {"controls": json.dumps([control.label for control in controls])} if controls else {}
    assumed = {"assumption": ASSUMPTION} if policy.masked else {}
    return {
        "features": json.dumps([feature.name for feature in features]),
        "units": json.dumps([feature.unit for feature in features]),
        "actions": json.dumps(list(policy.schema.actions)),
        **set_by,
        **assumed,
    }


def _onnx() -> ModuleType:
    with needed("onnx", "onnx"):
        import onnx
        import onnx.checker
        import onnx.helper
    module: ModuleType = onnx
    return module

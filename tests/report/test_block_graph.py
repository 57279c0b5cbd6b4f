"""Block graphs: the data against Drake's own lists, the layout's geometry, and each format read back by a parser."""

import json
import re
from itertools import combinations, pairwise
from xml.etree import ElementTree

import numpy as np
import pydot
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Gain, LogVectorOutput, Multiplexer

from drake_tc.errors import ParamsError
from drake_tc.report.block_graph.graph import block_graph
from drake_tc.report.block_graph.layout import layout
from drake_tc.report.block_graph.pictures import label_box, texts
from drake_tc.report.block_graph.place import shortened, text_width
from drake_tc.report.block_graph.view import view

from .block_graph_diagrams import DIAGRAMS, ODD, N, Stage, chain, nested, odd, staged, torque_loop


@pytest.fixture(scope="module", params=DIAGRAMS)
def diagram(request):
    return DIAGRAMS[request.param]()


@pytest.mark.parametrize("name", DIAGRAMS)
def test_json_lists_exactly_what_the_diagram_has(name):
    diagram = DIAGRAMS[name]()
    document = json.loads(block_graph(diagram).to_json())
    systems = diagram.GetSystems()
    shown = {id(s): b["path"] for s, b in zip(systems, document["blocks"], strict=True)}
    for system, block in zip(systems, document["blocks"], strict=True):
        assert block["name"] == system.get_name() or "@" in system.get_name()
        inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
        outputs = [system.get_output_port(i) for i in range(system.num_output_ports())]
        assert [(p["name"], p["size"]) for p in block["inputs"]] == [(p.get_name(), p.size()) for p in inputs]
        assert [(p["name"], p["size"]) for p in block["outputs"]] == [(p.get_name(), p.size()) for p in outputs]
    theirs = {
        (shown[id(s)], s.get_output_port(o).get_name(), shown[id(t)], t.get_input_port(i).get_name())
        for (t, i), (s, o) in diagram.connection_map().items()
    }
    ours = [
        (e["source"]["block"], e["source"]["port"], e["target"]["block"], e["target"]["port"])
        for e in document["edges"]
    ]
    assert len(ours) == len(diagram.connection_map()) and set(ours) == theirs
    assert [t["name"] for t in document["inputs"]] == ["push"] * diagram.num_input_ports()


def test_sizes_types_periods_and_feedthrough():
    document = json.loads(block_graph(torque_loop()).to_json())
    blocks = {b["name"]: b for b in document["blocks"]}
    edges = {
        (e["source"]["block"], e["target"]["block"], e["target"]["port"]): (e["size"], e["type"])
        for e in document["edges"]
    }
    assert edges["plant", "accelerometer", "body_poses"] == (0, "list[RigidTransform]")
    assert edges["inverse_dynamics", "torque_control", "torque_terms"] == (6 * N, "vector")
    assert blocks["plant"]["update"] == blocks["guard"]["update"] == {"period": 1e-3, "offset": 0.0}
    assert blocks["reference"]["update"] is None
    assert blocks["joint_filter"]["feedthrough"] == []
    assert blocks["actuators"]["feedthrough"] == [[0, 0], [1, 0]]


def test_stages_of_the_loop():
    stages = {b.name: b.stage for b in block_graph(torque_loop()).blocks}
    assert stages == {
        "plant": "plant",
        "reference": "reference",
        "inverse_dynamics": "control",
        "torque_control": "control",
        "guard": "control",
        "actuators": "actuation",
        "positions": "sensing",
        "encoder": "sensing",
        "accelerometer": "sensing",
        "gyroscope": "sensing",
        "joint_filter": "filtering",
        "imu_filter": "filtering",
        "estimator": "estimation",
        "monitor": "supervision",
        "VectorLogSink_1": "logging",
        "VectorLogSink_2": "logging",
    }
    chosen = block_graph(torque_loop(), stages={"positions": "plant", "Filter": "estimation"})
    stages = {b.name: b.stage for b in chosen.blocks}
    assert (stages["positions"], stages["joint_filter"], stages["imu_filter"]) == ("plant", "estimation", "estimation")


def forward_filter(kind, name, **attributes):
    """The stage of a block of a class between torque control and guard."""
    builder = DiagramBuilder()
    last = None
    for own, made in (
        ("before", staged("TorqueControl", "control.torque_control", {"u": N}, {"y": N})),
        (name, type(kind, (Stage,), {"__module__": "my_package", **attributes})({"u": N}, {"y": N})),
        ("after", staged("CommandGuard", "control.guard", {"u": N}, {"y": N})),
    ):
        system = builder.AddNamedSystem(own, made)
        if last is not None:
            builder.Connect(last.get_output_port(0), system.get_input_port(0))
        last = system
    return {b.name: b.stage for b in block_graph(builder.Build()).blocks}[name]


@pytest.mark.parametrize("name", ["offset", "filter", "torque_sensor", "monitor", "drive"])
def test_a_name_has_no_influence_on_the_stage(name):
    assert forward_filter("OffsetFilter", name) == "control"
    assert forward_filter("Clipping", name) == "control"


def test_a_tag_names_the_stage():
    assert forward_filter("OffsetFilter", "offset", graph_stage="filtering") == "filtering"
    with pytest.raises(ParamsError, match="block 'offset': no stage 'filter'; stages: reference, control"):
        forward_filter("OffsetFilter", "offset", graph_stage="filter")


def test_the_class_of_a_sensor_in_the_feedback_path_counts():
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", chain(N))
    sensor = builder.AddNamedSystem("q", type("MySensor", (Stage,), {"__module__": "mine"})({"u": 2 * N}, {"y": N}))
    control = builder.AddNamedSystem("c", type("MyController", (Stage,), {"__module__": "mine"})({"u": N}, {"y": N}))
    builder.Connect(plant.get_state_output_port(), sensor.get_input_port(0))
    builder.Connect(sensor.get_output_port(0), control.get_input_port(0))
    builder.Connect(control.get_output_port(0), plant.get_actuation_input_port())
    stages = {b.name: b.stage for b in block_graph(builder.Build()).blocks}
    assert stages == {"plant": "plant", "q": "sensing", "c": "control"}


def test_systems_that_only_logs_read_leave_no_dead_ends():
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource(np.ones(N)))
    control = builder.AddNamedSystem("control", staged("Guard", "control.guard", {"u": N}, {"y": N}))
    plant = builder.AddNamedSystem("plant", chain(N))
    scaled, seen = (builder.AddNamedSystem(name, Gain(2.0, N)) for name in ("scaled", "seen"))
    for start, end in ((source, control), (control, scaled), (scaled, seen)):
        builder.Connect(start.get_output_port(0), end.get_input_port(0))
    builder.Connect(control.get_output_port(0), plant.get_actuation_input_port())
    LogVectorOutput(seen.get_output_port(0), builder)
    LogVectorOutput(plant.get_state_output_port(), builder)
    graph = block_graph(builder.Build())
    assert [shape.title for shape in view(graph).shapes] == ["source", "control", "plant"]
    assert {"scaled", "seen"} <= {shape.title for shape in view(graph, everything=True).shapes}


def test_ports_that_drake_only_numbers_are_named_after_their_wires():
    """source.y0 and split.y1 feed named inputs, gain.u0 and gain.y0 stand between; split.y0 feeds two names."""
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("posture", ConstantVectorSource(np.ones(2 * N)))
    split = builder.AddNamedSystem("split", Demultiplexer([N, N]))
    gain = builder.AddNamedSystem("scaled", Gain(2.0, N))
    control = builder.AddNamedSystem("control", staged("Law", "control.law", {"q": N, "v": N, "a": N}, {"y": N}))
    builder.Connect(source.get_output_port(), split.get_input_port())
    builder.Connect(split.get_output_port(0), control.GetInputPort("q"))
    builder.Connect(split.get_output_port(0), control.GetInputPort("a"))
    builder.Connect(split.get_output_port(1), control.GetInputPort("v"))
    builder.Connect(control.get_output_port(0), gain.get_input_port())
    builder.ExportOutput(gain.get_output_port())
    graph = block_graph(builder.Build())
    names = {s.title: [[pin.name for pin in pins] for pins in (s.inputs, s.outputs)] for s in view(graph).shapes}
    assert names["posture"] == [[], ["posture"]]
    assert names["split"] == [["posture"], ["y0", "v"]]
    assert names["scaled"] == [["y"], ["scaled"]]
    ports = {block["name"]: block for block in json.loads(graph.to_json())["blocks"]}
    assert [port["name"] for port in ports["split"]["outputs"]] == ["y0", "y1"]  # programs get Drake's names


def test_a_multiplexer_that_only_a_log_reads_is_of_the_log():
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("reference", ConstantVectorSource(np.ones(2)))
    for name in ("kept", "shown"):
        builder.AddNamedSystem(name, Multiplexer([2, 2]))
        for i in range(2):
            builder.Connect(source.get_output_port(), builder.GetMutableSubsystemByName(name).get_input_port(i))
    LogVectorOutput(builder.GetSubsystemByName("kept").get_output_port(), builder)
    gain = builder.AddNamedSystem("controller", Gain(1.0, 4))
    builder.Connect(builder.GetSubsystemByName("shown").get_output_port(), gain.get_input_port())
    LogVectorOutput(gain.get_output_port(), builder)
    stages = {b.name: b.stage for b in block_graph(builder.Build()).blocks}
    assert (stages["kept"], stages["shown"], stages["controller"]) == ("logging", "control", "control")


@pytest.mark.parametrize(
    ("depth", "middle"),
    [(1, "level_2"), (2, "level_2::level_1"), (3, "level_2::level_1::level_0"), (4, "level_2::level_1::level_0::gain")],
)
def test_nested_diagrams_open_down_to_the_depth(depth, middle):
    graph = block_graph(nested(), depth=depth)
    assert [b.path for b in graph.blocks] == ["reference", middle, "hold"]
    assert [(e.source, e.target, e.size) for e in graph.edges] == [("reference", middle, 2), (middle, "hold", 2)]
    assert graph.blocks[1].feedthrough == ((0, 0),)
    if depth == 4:
        assert block_graph(nested(), depth=None) == graph


def test_the_same_diagram_gives_the_same_bytes():
    first, second = (block_graph(torque_loop()) for _ in range(2))
    for write in ("to_json", "to_svg", "to_dot", "to_mermaid"):
        assert getattr(first, write)() == getattr(second, write)()


def _cut(a, b, slack=0.0) -> bool:
    """Whether two boxes (left, top, right, bottom) share ground."""
    return min(a[2], b[2]) - max(a[0], b[0]) > slack and min(a[3], b[3]) - max(a[1], b[1]) > slack


@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize("name", DIAGRAMS)
def test_nothing_overlaps(name, everything):
    drawing = layout(view(block_graph(DIAGRAMS[name](), depth=None), everything=everything))
    boxes = [(p.x, p.y, p.x + p.width, p.y + p.box.height) for p in drawing.blocks]
    assert not [pair for pair in combinations(boxes, 2) if _cut(*pair)]
    regions = [(r.x, r.y, r.x + r.width, r.y + r.height) for r in drawing.regions]
    assert not [pair for pair in combinations(regions, 2) if _cut(*pair)]
    words = []
    for placed, box in zip(drawing.blocks, boxes, strict=True):
        for t in texts(placed):
            words.append((t.x, t.y - 0.72 * t.size, t.x + text_width(t.text, t.size, bold=t.bold), t.y + 0.2 * t.size))
            assert box[0] < words[-1][0] and words[-1][2] < box[2] and box[1] < words[-1][1] and words[-1][3] < box[3]
    labels = [(x, y - 9.0, x + width, y - 1.5) for x, y, width in map(label_box, drawing.wires)]
    assert not [pair for pair in combinations(words + labels, 2) if _cut(*pair)]
    assert not [(label, box) for label in labels for box in boxes if _cut(label, box)]
    pieces = [(n, a, b) for n, w in enumerate(drawing.wires) for line in w.lines for a, b in pairwise(line)]
    for n, a, b in pieces:
        assert a[0] == b[0] or a[1] == b[1], "a signal runs level or upright"
        thin = (min(a[0], b[0]), min(a[1], b[1]) - 0.1, max(a[0], b[0]), max(a[1], b[1]) + 0.1)
        if a[0] == b[0]:
            thin = (a[0] - 0.1, thin[1], a[0] + 0.1, thin[3])
        assert not [box for box in boxes if _cut(thin, box, 0.05)], f"signal {n} runs through a block"
        assert not [w for w in words + [label for m, label in enumerate(labels) if m != n] if _cut(thin, w, 0.05)]


@pytest.mark.parametrize("everything", [False, True])
@pytest.mark.parametrize("name", DIAGRAMS)
def test_no_two_signals_run_on_each_other(name, everything):
    drawing = layout(view(block_graph(DIAGRAMS[name](), depth=None), everything=everything))
    pieces = [(n, a, b) for n, w in enumerate(drawing.wires) for line in w.lines for a, b in pairwise(line)]
    for (n, a, b), (m, c, d) in combinations(pieces, 2):
        for axis in (0, 1):
            if n != m and a[axis] == b[axis] and c[axis] == d[axis] and abs(a[axis] - c[axis]) < 2.0:
                along = 1 - axis
                shared = min(max(a[along], b[along]), max(c[along], d[along])) - max(
                    min(a[along], b[along]), min(c[along], d[along])
                )
                assert shared < 0.5, f"signals {n} and {m} share a line"


def test_lines_of_neighbouring_rows_never_stand_above_each_other():
    """Two signals that swap places between the rows would otherwise lie on each other, whatever their order."""
    drawing = layout(view(block_graph(torque_loop()), everything=True))
    bands = sorted({(r.y, r.y + r.height) for r in drawing.regions})
    pieces = [(a, b) for w in drawing.wires for line in w.lines for a, b in pairwise(line)]
    upright = {(a[0], *sorted((a[1], b[1]))) for a, b in pieces if a[0] == b[0]}
    at = [{x for x, low, high in upright if low < bottom and top < high and low < high} for top, bottom in bands]
    assert len(at) == 3 and min(map(len, at)) > 1
    assert not [x for above, below in pairwise(at) for x in above for other in below if abs(x - other) < 4.0]


def test_every_connection_is_drawn_from_its_output_to_its_input():
    picture = view(block_graph(torque_loop()))
    drawing = layout(picture)
    placed = {p.box.shape.key: p for p in drawing.blocks}

    def spot(key, side, index):
        p = placed[key]
        right = (side == "o") == (p.flow > 0)
        return pytest.approx((p.x + p.width * right, p.y + p.box.heights[side, index]), abs=0.02)

    drawn = 0
    for wire in drawing.wires:
        for line, (key, index) in zip(wire.lines, wire.net.targets, strict=True):
            assert line[0] == spot(wire.net.source[0], "o", wire.net.source[1])
            assert line[-1] == spot(key, "i", index)
            drawn += 1
    logged = 2
    assert drawn == len(torque_loop().connection_map()) - logged + 1


def test_svg_is_well_formed_has_every_name_and_a_ground_of_its_own(diagram):
    graph = block_graph(diagram)
    root = ElementTree.fromstring(graph.to_svg(everything=True))
    shown = {"".join(t.itertext()) for t in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {shortened(b.name, 11.0, 190.0, bold=True) for b in graph.blocks} <= shown
    style = next(root.iter("{http://www.w3.org/2000/svg}style")).text
    assert "prefers-color-scheme: dark" in style
    assert next(root.iter("{http://www.w3.org/2000/svg}rect")).get("width") == "100%"


def test_dot_reads_back_with_its_clusters_and_ports(diagram):
    graph = block_graph(diagram)
    (parsed,) = pydot.graph_from_dot_data(graph.to_dot(everything=True))
    assert {c.get_name() for c in parsed.get_subgraphs()} >= {f"cluster_{b.stage}" for b in graph.blocks}
    nodes = {n.get_name(): n.get("label") for c in parsed.get_subgraphs() for n in c.get_nodes()}
    nodes.pop("graph")  # pydot lists the clusters' own attributes so
    assert len(nodes) == len(graph.blocks) + len(graph.inputs) + len(graph.outputs)
    assert len(parsed.get_edges()) == len(graph.edges) + len(graph.inputs) + len(graph.outputs)
    for edge in parsed.get_edges():
        for end in (edge.get_source(), edge.get_destination()):
            name, port = end.split(":")[:2]
            assert f"<{port}>" in nodes[name]


_MERMAID = re.compile(
    r"""flowchart\ LR\n
    (\ \ subgraph\ \w+\["[^"]*"\]\n(\ \ \ \ b\d+\["[^"\n]*"\]\n)+\ \ end\n)*
    (\ \ b\d+\ (-->|-\.->)\|"[^"|\n]*"\|\ b\d+\n)*
    (\ \ classDef\ dim\ [\w:.]+\n\ \ class\ b\d+(,b\d+)*\ dim\n)?""",
    re.VERBOSE,
)


def test_mermaid_keeps_to_the_grammar(diagram):
    graph = block_graph(diagram)
    text = graph.to_mermaid(everything=True)
    assert _MERMAID.fullmatch(text)
    assert len(re.findall(r'^    b\d+\["', text, re.MULTILINE)) == len(graph.blocks) + len(graph.inputs)
    assert len(re.findall(r"-->|-\.->", text)) == len(graph.edges) + len(graph.inputs)
    labels = re.findall(r'"([^"]*)"', text)
    plain = [re.sub(r"<br/>", "\n", label) for label in labels]
    assert not [label for label in plain if re.search(r"[<>{}|\\&]", label.replace("#38;", ""))]


def test_odd_names_come_back_from_every_format():
    graph = block_graph(odd())
    assert json.loads(graph.to_json())["blocks"][0]["name"] == ODD
    texts_shown = [t.text for p in layout(view(graph)).blocks for t in texts(p)]
    assert any(t.startswith('a "b" <c>') for t in texts_shown)
    coded = re.sub(r"#(\d+);", lambda m: chr(int(m[1])), graph.to_mermaid())
    assert ODD in coded
    label = re.search(r'b0 \[label="(.*?)(?<!\\)"\]', graph.to_dot())[1]
    assert ODD in re.sub(r"\\(.)", r"\1", label)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"diagram": Gain(1.0, 1)}, "expected a Drake Diagram, got Gain"),
        ({"depth": 0}, "depth of at least 1, got 0"),
        ({"stages": {"hold": "holding"}}, "'holding'; stages: reference, control"),
        ({"stages": {"holt": "control"}}, "no block 'holt'.*reference, level_2, hold"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(ParamsError, match=words):
        block_graph(**{"diagram": nested(), **arguments})


def test_empty_and_lonely_diagrams_can_be_drawn():
    builder = DiagramBuilder()
    builder.AddNamedSystem("alone", Gain(1.0, 1))
    assert "alone" in block_graph(builder.Build()).to_svg()
    builder = DiagramBuilder()
    LogVectorOutput(builder.AddSystem(ConstantVectorSource([1.0])).get_output_port(), builder)
    graph = block_graph(builder.Build(), stages={"ConstantVectorSource": "logging"})
    ElementTree.fromstring(graph.to_svg())

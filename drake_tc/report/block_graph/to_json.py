"""A block graph as JSON.

{"schema": 1, "diagram":, "stages": [names],
 "blocks": [{"path":, "name":, "kind":, "stage":, "inputs": [port], "outputs": [port], "feedthrough": [[input, output]],
             "update": {"period":, "offset":} or null}],
 "edges": [{"source": {"block":, "port":}, "target": {"block":, "port":}, "size":, "type":}],
 "inputs": [{port, "ends": [{"block":, "port":}]}], "outputs": [same]}
with port = {"name":, "size":, "type":}; blocks are named by path, ports of a block by name; times in seconds.
"""

import json
from typing import Any

from drake_tc.report.block_graph.data import STAGES, GraphData, Port, Terminal


def graph_json(graph: GraphData) -> str:
    """The whole graph; see the module."""
    blocks = {block.path: block for block in graph.blocks}

    def read(path: str, index: int) -> dict[str, str]:
        return {"block": path, "port": blocks[path].inputs[index].name}

    def made(path: str, index: int) -> dict[str, str]:
        return {"block": path, "port": blocks[path].outputs[index].name}

    def terminal(one: Terminal, end: Any) -> dict[str, Any]:
        return {**_port(one.port), "ends": [end(*e) for e in one.ends]}

    document = {
        "schema": 1,
        "diagram": graph.name,
        "stages": list(STAGES),
        "blocks": [
            {
                "path": b.path,
                "name": b.name,
                "kind": b.kind,
                "stage": b.stage,
                "inputs": [_port(p) for p in b.inputs],
                "outputs": [_port(p) for p in b.outputs],
                "feedthrough": [list(pair) for pair in b.feedthrough],
                "update": b.update and {"period": b.update.period, "offset": b.update.offset},
            }
            for b in graph.blocks
        ],
        "edges": [
            {
                "source": made(e.source, e.output),
                "target": read(e.target, e.input),
                "size": e.size,
                "type": e.type,
            }
            for e in graph.edges
        ],
        "inputs": [terminal(t, read) for t in graph.inputs],
        "outputs": [terminal(t, made) for t in graph.outputs],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _port(port: Port) -> dict[str, Any]:
    return {"name": port.name, "size": port.size, "type": port.type}

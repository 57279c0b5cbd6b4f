"""Blocks of Drake's own between the stages, which pick, join, add or multiply signals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.systems.primitives import Adder, Demultiplexer, MatrixGain, Multiplexer, Selector

from drake_tc.array_stage import Arrays, ArrayStage
from drake_tc.kernels.calls import ADD, MULTIPLY, KernelCall
from drake_tc.types import Call, FloatArray, IntArray

PICKING = (Multiplexer, Demultiplexer, Selector)
"""Blocks whose outputs are some of their inputs' elements."""
GLUE = (*PICKING, MatrixGain, Adder)


def picked_elements(system: Any) -> list[IntArray] | None:
    """For each output port, the indices of its elements among all inputs, stacked; None if the block computes.

    A MatrixGain computes even where its matrix only selects: 0 times NaN is NaN.
    """
    if not isinstance(system, PICKING):
        return None
    context, first = system.CreateDefaultContext(), 0
    for index in range(system.num_input_ports()):
        port: Any = system.get_input_port(index)
        port.FixValue(context, np.arange(first, first + port.size(), dtype=np.float64))
        first += port.size()
    outputs = (system.get_output_port(index) for index in range(system.num_output_ports()))
    return [np.asarray(output.Eval(context)).astype(np.intp) for output in outputs]


def computed(system: Any) -> ArrayStage:
    """The stage of an Adder or a MatrixGain."""
    count, output = system.num_input_ports(), system.get_output_port(0)
    names = [system.get_input_port(index).get_name() for index in range(count)]
    matrix = np.ascontiguousarray(system.D()) if isinstance(system, MatrixGain) else None

    def bind(arrays: Arrays) -> tuple[Call, None]:
        terms, out = [arrays.inputs[name] for name in names], arrays.out
        return (_sum_of(terms, out) if matrix is None else _product_of(matrix, terms[0], out)), None

    width = output.size()
    return ArrayStage(width, {output.get_name(): np.arange(width)}, bind, frozenset(names))


def _sum_of(terms: Sequence[FloatArray], out: FloatArray) -> Call:
    """Sum from the first term on, as Drake's Adder does."""
    first, second, *others = terms if len(terms) > 1 else (terms[0], np.zeros(out.size))

    def outputs(time: float) -> None:
        np.add(first, second, out)
        for term in others:
            np.add(out, term, out)

    return outputs if others else KernelCall(ADD, outputs, first, second, out)


def _product_of(matrix: FloatArray, factor: FloatArray, out: FloatArray) -> Call:
    def outputs(time: float) -> None:
        out[:] = 0.0  # column by column, as Drake and the kernel: another order of the sum gives other last bits
        for j in range(factor.size):
            np.add(out, matrix[:, j] * factor[j], out)

    return KernelCall(MULTIPLY, outputs, matrix, factor, out)

"""Translation of the statements of a function."""

from __future__ import annotations

import ast
from typing import Any

from flightstack.firmware.generator.assignments import Assignments
from flightstack.firmware.generator.expressions import MISSING, Expressions
from flightstack.firmware.generator.law import Function, python_function
from flightstack.firmware.generator.subset import construct_of
from flightstack.firmware.generator.text import identifier
from flightstack.firmware.generator.types import INT, NOTHING, Several, has_arrays
from flightstack.firmware.generator.unit import Unit
from flightstack.firmware.generator.values import SUM, Value
from flightstack.firmware.generator.writer import Variable, Writer, declaration


def translate(function: Function, unit: Unit) -> None:
    """Write the body of a function in C; raise OutsideSubsetError."""
    Statements(function, unit).run()


class Statements:
    """Translates the statements of one function."""

    def __init__(self, function: Function, unit: Unit) -> None:
        self.function, self.writer = function, Writer(function, unit)
        self.expressions = Expressions(function, self.writer)
        self._last_line = function.node.body[0].lineno - 1
        self.assignments = Assignments(function, self.writer, self.expressions)
        self._loops = self.writer.loops

    def run(self) -> None:
        """Translate the whole function."""
        writer, function = self.writer, self.function
        body = function.node.body
        is_documented = ast.get_docstring(function.node) is not None
        if is_documented:
            self._last_line = body[0].end_lineno or body[0].lineno
        returns = self._block(body[1:] if is_documented else body)
        if not returns and function.result is not NOTHING:
            raise function.refusal(function.node, "result", f"end of {function.name} without a result")
        if writer.lines and writer.lines[-1] == (1, "return;"):
            writer.lines.pop()
        function.lines = writer.text()

    # ------------------------------------------------------------------ blocks

    def _block(self, statements: list[ast.stmt]) -> bool:
        """Translate statements; return True if control never leaves at their end."""
        for statement in statements:
            self._remarks(statement)
            translate_one = getattr(self, f"_{type(statement).__name__.lower()}", None)
            if translate_one is None:
                raise self.function.refusal(statement, construct_of(statement))
            since = len(self.writer.lines)
            ends = bool(translate_one(statement))
            if not isinstance(statement, ast.If | ast.For):
                self._trailing(statement, since)
            self._last_line = max(self._last_line, statement.end_lineno or statement.lineno)
            if ends:
                return True
        return False

    def _remarks(self, statement: ast.stmt) -> None:
        """Copy the comments above a statement."""
        for number in range(self._last_line + 1, statement.lineno):
            text = self.function.comments.get(number)
            if text:
                self.writer.remark(text, len(self.writer.lines))

    def _trailing(self, statement: ast.stmt, since: int) -> None:
        """Copy the comments within a statement."""
        numbers = range(statement.lineno, (statement.end_lineno or statement.lineno) + 1)
        texts = [self.function.comments[number] for number in numbers if number in self.function.comments]
        if texts:
            self.writer.remark("; ".join(texts), since)

    def _nested(self, statements: list[ast.stmt]) -> bool:
        """Translate an inner block."""
        writer, outer = self.writer, self.writer.path
        if not statements:
            return False
        writer.path = writer.usage.block(statements)
        writer.depth += 1
        ends = self._block(statements)
        writer.depth -= 1
        writer.path = outer
        return ends

    def _compound(self, statement: ast.If | ast.For) -> bool:
        """Translate an ``if`` or a loop after the variables that it assigns for later."""
        writer = self.writer
        if writer.path == ():
            for parameter in self.function.parameters:
                assigned = any(
                    isinstance(node, ast.Name)
                    and isinstance(node.ctx, ast.Store)
                    and node.id == parameter.name
                    for node in ast.walk(statement)
                )
                if assigned and writer.variables[parameter.name].name == identifier(parameter.name):
                    writer.copy_parameter(parameter.name)
        with writer.aside() as lines:
            ends = self._branch(statement) if isinstance(statement, ast.If) else self._loop(statement)
        for variable in writer.pending.pop(writer.path, []):
            writer.line(declaration(variable))
        writer.lines += lines
        return ends

    def _if(self, node: ast.If) -> bool:
        return self._compound(node)

    def _for(self, node: ast.For) -> bool:
        return self._compound(node)

    def _branch(self, node: ast.If) -> bool:
        writer = self.writer
        test = self.expressions.condition(node.test)
        note = self.function.comments.get(node.lineno)
        since = len(writer.lines)
        writer.line(f"if ({test.text}) {{")
        if note:
            writer.remark(note, since)
        self._last_line = node.lineno
        before = set(writer.assigned)
        yes_ends = self._nested(node.body)
        after_yes, writer.assigned = writer.assigned, set(before)
        if node.orelse:
            writer.line("} else {")
            no_ends = self._nested(node.orelse)
        else:
            no_ends = False
        writer.line("}")
        if yes_ends:
            pass
        elif no_ends:
            writer.assigned = after_yes
        else:
            writer.assigned &= after_yes
        return yes_ends and no_ends

    # ------------------------------------------------------------------ loops

    def _loop(self, node: ast.For) -> bool:
        writer = self.writer
        if node.orelse:
            raise self.function.refusal(node.orelse[0], "else of a loop")
        is_range = isinstance(node.iter, ast.Call) and self.expressions.constant(node.iter.func) is range
        if not is_range or not isinstance(node.target, ast.Name):
            raise self.function.refusal(node, "for loop over values")
        assert isinstance(node.iter, ast.Call)
        assert isinstance(node.target, ast.Name)
        name = node.target.id
        if writer.usage.stores.get(name) or name in self._loops:
            raise self.function.refusal(node, "loop variable", f"assignment to {name}")
        start, stop, step = self._bounds(node.iter)
        if stop.rank < SUM:  # a condition, which the body may change
            stop = writer.hoist(stop, "stop")
        c_name = identifier(name) if name.strip("_") else writer.fresh("count")
        sign = "<" if step > 0 else ">"
        change = {1: f"{c_name}++", -1: f"{c_name}--"}.get(
            step, f"{c_name} {'+' if step > 0 else '-'}= {abs(step)}"
        )
        writer.line(f"for (int32_t {c_name} = {start.text}; {c_name} {sign} {stop.text}; {change}) {{")
        writer.variables[name] = Variable(c_name, INT, root=name)
        before = set(writer.assigned)
        writer.assigned.add(name)
        self._loops.append(name)
        self._last_line = node.lineno
        self._nested(node.body)
        self._loops.pop()
        del writer.variables[name]
        writer.line("}")
        runs = [start.literal, stop.literal]
        is_certain = all(isinstance(bound, int) for bound in runs) and len(range(runs[0], runs[1], step)) > 0  # type: ignore[arg-type]
        leaves = any(isinstance(inner, ast.Break | ast.Continue) for inner in ast.walk(node))
        writer.assigned = writer.assigned - {name} if is_certain and not leaves else before
        return False

    def _bounds(self, node: ast.Call) -> tuple[Value, Value, int]:
        arguments = [self._bound(argument) for argument in node.args]
        if node.keywords or not 1 <= len(arguments) <= 3:
            raise self.function.refusal(node, "arguments", "arguments of range")
        if len(arguments) == 1:
            arguments.insert(0, self.expressions.literal(node, 0))
        step = arguments[2].literal if len(arguments) == 3 else 1
        if not isinstance(step, int) or step == 0:
            raise self.function.refusal(node, "loop bound", "step of a loop")
        return arguments[0], arguments[1], step

    def _bound(self, node: ast.expr) -> Value:
        """Return a bound: constants, sizes of arrays and variables of outer loops."""
        constant = self.expressions.constant(node)
        if isinstance(constant, int) and not isinstance(constant, bool):
            return self.expressions.literal(node, constant)
        value = self.expressions.value(node)
        if value.type is not INT or not self.expressions.bounds.accepts(node):
            raise self.function.refusal(node, "loop bound", f"loop bound {ast.unparse(node)}")
        return value

    def _break(self, _: ast.Break) -> bool:
        self.writer.line("break;")
        return True

    def _continue(self, _: ast.Continue) -> bool:
        self.writer.line("continue;")
        return True

    def _pass(self, _: ast.Pass) -> bool:
        return False

    def _annassign(self, node: ast.AnnAssign) -> bool:
        return self.assignments.annotated(node)

    def _assign(self, node: ast.Assign) -> bool:
        return self.assignments.assign(node)

    def _augassign(self, node: ast.AugAssign) -> bool:
        return self.assignments.augmented(node)

    # ------------------------------------------------------------------ ends

    def _expr(self, node: ast.Expr) -> bool:
        if not isinstance(node.value, ast.Call):
            raise self.function.refusal(node, "statement", f"expression {ast.unparse(node)}")
        target: Any = self.expressions.constant(node.value.func)
        if target is MISSING or python_function(target) is None:
            self.expressions.value(node.value)
            raise self.function.refusal(node, "statement", f"expression {ast.unparse(node)}")
        callee = self.expressions.calls.callee(node.value, target)
        if isinstance(callee.result, Several):
            names = ast.Tuple([ast.Name("_", ast.Store()) for _ in callee.result.items], ast.Store())
            self.assignments.call_into(names, node.value, callee)
            return False
        value = self.expressions.calls.call(node.value, alone=True)
        self.writer.line(f"{value.text};" if value.type is NOTHING else f"(void){value.text};")
        return False

    def _return(self, node: ast.Return) -> bool:
        function, writer = self.function, self.writer
        if function.result is NOTHING:
            if node.value is not None:
                raise function.refusal(node, "result", "value of a function without a result")
            writer.line("return;")
            return True
        if node.value is None:
            raise function.refusal(node, "result", "return without a value")
        if isinstance(function.result, Several):
            self._return_several(node, node.value)
            return True
        call = (
            self.expressions.calls.call(node.value, alone=True) if isinstance(node.value, ast.Call) else None
        )
        value = call or self.expressions.value(node.value)
        made = self.expressions.calls.converted(node, value, function.result)
        if has_arrays(function.result):
            self._return_part(node, made)
        else:
            writer.store("return ", made)
        return True

    def _return_part(self, node: ast.Return, value: Value) -> None:
        """Note the part of the parameter that callers take: C returns no arrays."""
        owner, body = value.owner, [part for part in self.function.node.body if part is not node]
        is_only = all(isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant) for part in body)
        if owner is None or owner.text != owner.root or len(self.function.parameters) != 1 or not is_only:
            raise self.function.refusal(node, "NamedTuple of arrays", "result that is arrays of a NamedTuple")
        self.function.part = value.text.removeprefix(f"{owner.text}->")

    def _return_several(self, node: ast.Return, value: ast.expr) -> None:
        writer, outputs = self.writer, self.function.outputs
        if isinstance(value, ast.Tuple) and len(value.elts) == len(outputs):
            values = [
                self.expressions.calls.converted(element, self.expressions.value(element), kind)
                for element, (_, kind) in zip(value.elts, outputs, strict=True)
            ]
            for (name, _), made in zip(outputs, values, strict=True):
                writer.store(f"*{name} = ", made)
        else:
            target = self.expressions.constant(value.func) if isinstance(value, ast.Call) else None
            if not isinstance(value, ast.Call) or python_function(target) is None:
                raise self.function.refusal(node, "tuple", "result that is no tuple")
            callee = self.expressions.calls.callee(value, target)
            if callee.result != self.function.result:
                raise self.function.refusal(node, "values of different types", "result of other types")
            arguments = self.expressions.calls.arguments(value, callee)
            writer.line(f"{callee.c_name}({', '.join([*arguments, *(name for name, _ in outputs)])});")
        writer.line("return;")

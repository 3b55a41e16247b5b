"""The JSON schema of a file of test vectors, as `schema.json` beside the files has it."""

from __future__ import annotations

from typing import Any

FORMAT = "ssr_ref test vectors"
SCHEMA_VERSION = 1

_HEX = "^-?0x[0-9a-f]+(\\.[0-9a-f]+)?(p[+-][0-9]+)?$"
_COUNT = {"type": "integer", "minimum": 1}
_FIELD = {
    "type": "object",
    "required": ["name", "shape", "type"],
    "properties": {
        "name": {"type": "string", "pattern": "^[a-z][a-z0-9_]*$"},
        "shape": {"type": "array", "items": _COUNT},
        "type": {"enum": ["float", "int32", "uint32"]},
        "measure": {"enum": ["exact", "component", "norm", "absolute"]},
    },
    "additionalProperties": False,
}
_NUMBER = {
    "oneOf": [
        {
            "type": "object",
            "description": "a finite number: both texts are exact",
            "required": ["decimal", "hex"],
            "properties": {
                "decimal": {"type": "number"},
                "hex": {
                    "type": "string",
                    "pattern": _HEX,
                },
            },
            "additionalProperties": False,
        },
        {
            "type": "object",
            "description": "no number: `class` says what is expected",
            "required": ["class", "decimal", "hex"],
            "properties": {
                "class": {"enum": ["nan", "+inf", "-inf"]},
                "decimal": {"type": "null"},
                "hex": {"enum": ["nan", "inf", "-inf"]},
            },
            "additionalProperties": False,
        },
    ]
}
_VALUES = {"type": "object", "additionalProperties": {"$ref": "#/$defs/value"}}
_TOLERANCE = {
    "oneOf": [
        {"type": "number", "minimum": 0},
        {"type": "null", "description": "nothing is asked of this format"},
    ]
}


def _by_format(value: dict[str, Any]) -> dict[str, Any]:
    return {
        "type": "object",
        "required": ["float32", "float64"],
        "properties": {"float32": value, "float64": value},
        "additionalProperties": False,
    }


SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": FORMAT,
    "type": "object",
    "required": [
        "format",
        "schema_version",
        "name",
        "kernel",
        "form",
        "measure",
        "bound",
        "why",
        "source",
        "inputs",
        "outputs",
        "cases",
    ],
    "properties": {
        "format": {"const": FORMAT},
        "schema_version": {"const": SCHEMA_VERSION},
        "name": {"type": "string", "pattern": "^[a-z][a-z0-9_]*$"},
        "kernel": {"type": "string", "pattern": "^[a-z][a-z0-9_]*$"},
        "form": {"type": "string"},
        "measure": {"enum": ["exact", "component", "norm", "absolute"]},
        "bound": {"type": "number", "minimum": 0},
        "why": {"type": "string"},
        "source": {"type": "string"},
        "inputs": {"type": "array", "minItems": 1, "items": _FIELD},
        "outputs": {"type": "array", "minItems": 1, "items": _FIELD},
        "cases": {
            "type": "array",
            "minItems": 1,
            "items": {
                "type": "object",
                "required": ["name", "condition", "tolerance_ulp", "inputs", "outputs"],
                "properties": {
                    "name": {"type": "string", "pattern": '^[^,"]+$'},
                    "condition": {
                        "oneOf": [
                            {"type": "number", "minimum": 0},
                            {"type": "null", "description": "infinite"},
                        ]
                    },
                    "tolerance_ulp": _by_format(_TOLERANCE),
                    "inputs": _VALUES,
                    "outputs": _by_format(_VALUES),
                },
                "additionalProperties": False,
            },
        },
    },
    "additionalProperties": False,
    "$defs": {
        "number": _NUMBER,
        "value": {
            "oneOf": [
                {"$ref": "#/$defs/number"},
                {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/value"}},
            ]
        },
    },
}

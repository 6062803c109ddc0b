"""Prints what is wrong with JSON files by a schema of docs/schemas, one line each; nothing if all is well.

Keys that the schema does not describe are wrong here, so that none is added without a description; readers of the
files should pass over keys that they do not know.

Usage: validate_json.py SCHEMA FILE...
"""
import json
import pathlib
import sys

import jsonschema


def load(path):
    return json.loads(pathlib.Path(path).read_text())


def closed(schema):
    """The schema with no other keys allowed than those it describes."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    result = {key: closed(value) for key, value in schema.items()}
    # "properties" may also be the name of a key that is described; then its value is no object of schemas.
    if schema.get("type") == "object" and "properties" in schema:
        result.setdefault("additionalProperties", False)
    return result


folder = pathlib.Path(sys.argv[1]).resolve().parent
schemas = {path.name: closed(load(path)) for path in folder.glob("*.schema.json")}
schema = schemas[pathlib.Path(sys.argv[1]).name]
for one in schemas.values():
    jsonschema.Draft7Validator.check_schema(one)
resolver = jsonschema.RefResolver(schema["$id"], schema, store={one["$id"]: one for one in schemas.values()})
validator = jsonschema.Draft7Validator(schema, resolver=resolver)
for name in sys.argv[2:]:
    for error in validator.iter_errors(load(name)):
        place = "/".join(str(step) for step in error.absolute_path)
        print(f"{name}: /{place}: {error.message[:200]}")

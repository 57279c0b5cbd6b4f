import json

import numpy as np

from drake_tc.config.quoted import json_value


def test_what_json_has_no_number_for_is_null_however_deep():
    value = {"a": [1.5, np.inf, {"b": (np.float64("nan"), 2)}], "c": np.array([[1.0, -np.inf]]), "d": "text", "e": None}
    text = json.dumps(json_value(value), allow_nan=False)
    assert json.loads(text) == {"a": [1.5, None, {"b": [None, 2]}], "c": [[1.0, None]], "d": "text", "e": None}

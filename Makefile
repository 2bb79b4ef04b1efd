.PHONY: demo test slow lint docs bench sample
demo:
	wallkit demo --overwrite
test:
	pytest -q
slow:
	pytest -q -m slow
lint:
	ruff check . && ruff format --check . && mypy
docs:
	python docs/build.py
bench:
	wallkit bench update --numpy
sample:
	python -m wallkit.pipelines.sample wallkit/sample

.PHONY: demo test long slow guides lint docs bench sample calibration evaluation-set evaluation-calibration
demo:
	wallkit demo --overwrite
test:
	pytest -q
long:
	pytest -q -m 'long and not slow'
slow:
	pytest -q -m slow
guides:
	pytest -q -m guide tests/test_docs.py
lint:
	ruff check . && ruff format --check . && mypy
docs:
	python docs/build.py
bench:
	wallkit bench update --numpy
sample:
	python -m wallkit.pipelines.sample
# the sample robot's calibration, calib/front.toml and calib/laser-to-front.toml (needs OpenGL, some minutes; exit code 4 is CANNOT TELL)
calibration:
	rm -rf build/calibration && mkdir -p build/calibration && cp calib/boards/*.toml calib/robot.urdf build/calibration
	cd build/calibration && wallkit simulate boards --board charuco-a3.toml --robot robot.urdf -s lidar.frame=laser \
		--anywhere --near 0.25 --far 0.7 --count 60 --seed 2 -o lens
	cd build/calibration && wallkit simulate boards --board chessboard-plate-610x850.toml --robot robot.urdf -s lidar.frame=laser \
		--count 40 --seed 1 -o boards
	cd build/calibration && wallkit simulate boards --board chessboard-plate-610x850.toml --robot robot.urdf -s lidar.frame=laser \
		--count 40 --seed 3 -o again
	cd build/calibration && wallkit calib intrinsics lens/images --board charuco-a3.toml --name front --frame front_camera_optical \
		-o front.toml || test $$? -eq 4
	cd build/calibration && wallkit calib extrinsics boards/images --scans boards/scans --board chessboard-plate-610x850.toml \
		--camera front.toml --lidar laser --sigma-range 10mm -o laser-to-front.toml
	cd build/calibration && wallkit calib verify again/images --scans again/scans --board chessboard-plate-610x850.toml \
		--calib laser-to-front.toml --lidar-sigma 10mm --urdf robot.urdf --write
	cp build/calibration/front.toml build/calibration/laser-to-front.toml calib/
# EVAL: which logs; JOBS: how many at once
EVAL ?= *
JOBS ?= 1
evaluation-set:
	wallkit simulate set evaluation --only '$(EVAL)' --jobs $(JOBS) -o evaluation-logs
# the calibration of the set's front camera, evaluation/front.toml, by simulated boards (needs OpenGL; exit code 4 is CANNOT TELL)
evaluation-calibration:
	rm -rf build/evaluation && mkdir -p build/evaluation
	cp calib/boards/*.toml evaluation/robot.urdf evaluation/sensors.toml build/evaluation
	cd build/evaluation && wallkit simulate boards --board charuco-a3.toml --robot robot.urdf --scenario sensors.toml \
		--anywhere --near 0.25 --far 0.7 --count 60 --seed 2 -o lens
	cd build/evaluation && wallkit simulate boards --board chessboard-plate-610x850.toml --robot robot.urdf --scenario sensors.toml \
		--count 150 --near 0.9 --seed 1 -o boards
	cd build/evaluation && wallkit simulate boards --board chessboard-plate-610x850.toml --robot robot.urdf --scenario sensors.toml \
		--count 40 --seed 3 -o again
	cd build/evaluation && wallkit calib intrinsics lens/images --board charuco-a3.toml --name front --frame camera_front_optical \
		-o lens.toml || test $$? -eq 4
	cd build/evaluation && wallkit calib extrinsics boards/images --scans boards/scans --board chessboard-plate-610x850.toml \
		--camera lens.toml --lidar laser --sigma-range 18mm -o front.toml
	cd build/evaluation && wallkit calib verify again/images --scans again/scans --board chessboard-plate-610x850.toml \
		--calib front.toml --lidar-sigma 18mm --write || test $$? -eq 4
	cp build/evaluation/front.toml evaluation/

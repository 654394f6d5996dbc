"""Vessels with three degrees of freedom: surge, sway and yaw.

- `simnav.world.manoeuvring.dynamics`: the equations of motion and the autopilot, compiled
- `simnav.world.manoeuvring.hull`: the coefficients of a hull
- `simnav.world.manoeuvring.vessel`: what makes a registered vessel of a hull
- `simnav.world.manoeuvring.sea_trials`: turning circle and zigzag of a hull
- ``survey_ship``, ``ferry``, ``workboat``, ``surface_drone``, ``auv``: one vessel each, with the source of its figures
"""

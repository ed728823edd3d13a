from .gap_page import gap_html as gap_html
from .notebook import Page as Page, animate as animate
from .pages import (
    Section as Section,
    execution_html as execution_html,
    plan_html as plan_html,
    region_html as region_html,
    report_html as report_html,
    slide_html as slide_html,
    surface_html as surface_html,
)
from .scene_page import scene_html as scene_html

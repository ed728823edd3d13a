from .arrays import (
    LARGEST_MAGNITUDE as LARGEST_MAGNITUDE,
    LEAST_POSITIVE as LEAST_POSITIVE,
    BoolArray as BoolArray,
    FloatArray as FloatArray,
    check_array as check_array,
    check_choice as check_choice,
    check_count as check_count,
    check_number as check_number,
    check_seed as check_seed,
    check_sense as check_sense,
    check_share as check_share,
    check_vectors as check_vectors,
    check_zero_or_positive as check_zero_or_positive,
    first_least as first_least,
    order_with_ties as order_with_ties,
    read_only as read_only,
)
from .binomial import binomial_interval as binomial_interval
from .brief import brief as brief
from .build_lock import BuildLock as BuildLock
from .children import (
    end_with_parent as end_with_parent,
    isolated_environment as isolated_environment,
    run_child as run_child,
    start_child as start_child,
)
from .collecting import without_collecting as without_collecting
from .compiled import (
    compiled as compiled,
    inlined as inlined,
    inner as inner,
    is_cached as is_cached,
    watch_builds as watch_builds,
)
from .deadline import Deadline as Deadline, within as within
from .errors import (
    ConvergenceError as ConvergenceError,
    EffectError as EffectError,
    InputError as InputError,
    OutOfTimeError as OutOfTimeError,
    PlanWarning as PlanWarning,
    PlausibilityWarning as PlausibilityWarning,
    SolverError as SolverError,
    StablepushError as StablepushError,
    StablepushWarning as StablepushWarning,
    UnavailableError as UnavailableError,
    UnsupportedContactError as UnsupportedContactError,
)
from .first_build import at_first_build as at_first_build
from .html_pictures import shown_as as shown_as
from .json_node import Node as Node, describe as describe
from .parallel import (
    in_threads as in_threads,
    one_blas_thread as one_blas_thread,
    run_parallel as run_parallel,
    usable_cores as usable_cores,
)
from .paths import real_path as real_path
from .plausibility import (
    note_cors as note_cors,
    note_distance as note_distance,
    note_finger as note_finger,
    note_friction as note_friction,
    note_gravity as note_gravity,
    note_heading as note_heading,
    note_headings as note_headings,
    note_margin as note_margin,
    note_mass as note_mass,
    note_mounting as note_mounting,
    note_noise as note_noise,
    note_off_outline as note_off_outline,
    note_overlap as note_overlap,
    note_part as note_part,
    note_pressure as note_pressure,
    note_push_speed as note_push_speed,
    note_quantity as note_quantity,
    note_scene as note_scene,
    note_size as note_size,
    note_slide as note_slide,
    note_time as note_time,
    note_tolerance as note_tolerance,
    note_tool as note_tool,
)
from .plugins import load_plugin as load_plugin, plugin_names as plugin_names, what_failed as what_failed
from .scratch import (
    ASIDE as ASIDE,
    clear_scratch as clear_scratch,
    scratch_folder as scratch_folder,
    scratch_prefix as scratch_prefix,
)
from .shown import shown as shown
from .words import (
    Word as Word,
    closest as closest,
    counted as counted,
    did_you_mean as did_you_mean,
    some_of as some_of,
)

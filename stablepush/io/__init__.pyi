from .formats import (
    contact_or_path as contact_or_path,
    contact_to_json as contact_to_json,
    load_contact as load_contact,
    load_model as load_model,
    load_slider as load_slider,
    model_from_node as model_from_node,
    model_or_path as model_or_path,
    model_to_json as model_to_json,
    save_contact as save_contact,
    save_model as save_model,
    save_slider as save_slider,
    slider_from_node as slider_from_node,
    slider_or_path as slider_or_path,
    slider_to_json as slider_to_json,
)
from .frozen_sensors import (
    dead_columns as dead_columns,
    dead_words as dead_words,
    frozen as frozen,
    stopped as stopped,
    stopped_words as stopped_words,
)
from .json_files import read_json as read_json
from .log_warnings import unit_doubts as unit_doubts
from .movingai import load_movingai_map as load_movingai_map
from .pushlog import (
    LOG_FILES as LOG_FILES,
    Noise as Noise,
    PushLog as PushLog,
    Rig as Rig,
    distinct as distinct,
    end_of_motion as end_of_motion,
    read_pushlog as read_pushlog,
    rig_to_json as rig_to_json,
    write_pushlog as write_pushlog,
)
from .recorded_pushes import slope_weights as slope_weights
from .tables import (
    IS_POSITIVE as IS_POSITIVE,
    IS_SENSE as IS_SENSE,
    Column as Column,
    read_table as read_table,
    table_text as table_text,
)
from .world import centered_rig as centered_rig, log_from_arrays as log_from_arrays, pokes_from_world as pokes_from_world
from .writing import (
    require_own_files as require_own_files,
    whole_folder as whole_folder,
    write_atomically as write_atomically,
    write_json as write_json,
)

from .commands import (
    Command as Command,
    contact_push as contact_push,
    edge_command as edge_command,
    random_pushes as random_pushes,
)
from .execution import (
    execute_closed_loop as execute_closed_loop,
    execute_plan as execute_plan,
    plan_commands as plan_commands,
    require_contacts as require_contacts,
)
from .push_lists import (
    read_commands as read_commands,
    read_pushes as read_pushes,
    write_pushes as write_pushes,
)
from .simulator_models import export_mjcf as export_mjcf, export_sdf as export_sdf
from .virtual_rig import Execution as Execution, VirtualRig as VirtualRig, execute_batch as execute_batch

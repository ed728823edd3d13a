from .commands import (
    Command as Command,
    contact_push as contact_push,
    poke as poke,
    random_pushes as random_pushes,
    read_commands as read_commands,
)
from .execution import (
    execute_closed_loop as execute_closed_loop,
    execute_plan as execute_plan,
    plan_commands as plan_commands,
    require_contacts as require_contacts,
)
from .virtual_rig import Execution as Execution, VirtualRig as VirtualRig, execute_batch as execute_batch

from domains.robots_in_cycles.bringup import line_follower as line_follower
from domains.robots_in_cycles.bringup import obstacle_avoider as obstacle_avoider
from domains.robots_in_cycles.drives import Drive as Drive
from domains.robots_in_cycles.drives import avoid as avoid
from domains.robots_in_cycles.drives import follow as follow

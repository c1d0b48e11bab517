from domains.attention.bringup import bundle as bundle
from domains.attention.gaze import Attention as Attention
from domains.attention.gaze import GazeDriver as GazeDriver

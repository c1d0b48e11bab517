from domains.dialogue.bringup import bundle as bundle
from domains.dialogue.channels import Channel as Channel
from domains.dialogue.channels import Console as Console
from domains.dialogue.channels import Script as Script
from domains.dialogue.channels import TextFiles as TextFiles
from domains.dialogue.speech import Dialogue as Dialogue

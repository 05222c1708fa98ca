"""Why a part cannot leave."""

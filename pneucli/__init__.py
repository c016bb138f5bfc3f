"""pneucli: from recordings of a servo-pneumatic axis to models, the missing effect, and a validated controller."""

__version__ = "0.1.0"

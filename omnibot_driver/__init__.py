"""ROS 2 driver for the Neuron OmniBot three-omni-wheel base."""

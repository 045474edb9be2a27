"""From a model file to waypoints: plan, progress, predicted and measured times of arrival."""
